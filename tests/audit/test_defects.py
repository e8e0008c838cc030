"""Defects that need no geometry, one by one, on logs small enough to count by hand."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock import BeamGeometry
from bottomlock.audit import defects
from bottomlock.audit.logs import BeamLog, read_log, read_reference
from bottomlock.audit.run import Audit, audit_file
from bottomlock.errors import DataError
from tests.audit.synthetic import Array


def log(time_s: list[float], y: np.ndarray[tuple[int, int], np.dtype[np.float64]] | None = None) -> BeamLog:
    values = np.arange(4.0 * len(time_s)).reshape(-1, 4) + 1.0 if y is None else y
    return BeamLog(
        "hand", np.round(np.array(time_s) * 1e9).astype(np.int64), values, np.ones(values.shape, bool)
    )


def test_times_that_repeat_go_back_and_jump() -> None:
    found = {one.kind: one for one in defects.times(log([0, 1, 2, 2, 3, 4, 3.5, 5, 6, 60, 61]))}
    assert set(found) == {"time_repeats", "time_goes_back", "time_gaps"}
    assert "row 3" in found["time_repeats"].evidence
    assert "row 6" in found["time_goes_back"].evidence
    assert "before row 9" in found["time_gaps"].evidence
    assert found["time_gaps"].severity == "warning"


def test_even_times_are_not_named() -> None:
    assert list(defects.times(log([0.0, 0.2, 0.41, 0.6, 0.8]))) == []


def test_unchanged_pings() -> None:
    """Row 2 repeats row 1; row 4 repeats row 3 in three beams only; row 5 is all zero like row 6."""
    y = np.array(
        [[1, 2, 3, 4], [5, 6, 7, 8], [5, 6, 7, 8], [1, 1, 1, 1], [1, 1, 1, 2], [0, 0, 0, 0], [0, 0, 0, 0]]
    )
    assert np.flatnonzero(log(list(range(7)), y.astype(float)).unchanged).tolist() == [2]


def test_flags_of_the_instrument() -> None:
    base = log(list(range(6)))
    valid = base.valid.copy()
    valid[4, :2] = False
    told = BeamLog(
        "hand", base.time_ns, base.velocity_mps, valid, np.ones((6, 3)),
        np.array([True, False, True, True, True, True]),
    )  # fmt: skip
    kinds = {one.kind: one for one in defects.instrument_flags(told)}
    assert set(kinds) == {"rejected_by_instrument", "velocity_without_beams"}
    assert "row 1" in kinds["rejected_by_instrument"].evidence
    assert "row 4" in kinds["velocity_without_beams"].evidence


def test_account_of_the_reader_is_told() -> None:
    beside = {"records_read": 100, "skipped": {"bad checksum": {"count": 3, "first_byte": 77}}, "flagged": {}}
    one = BeamLog("hand", np.arange(3), np.ones((3, 4)), np.ones((3, 4), bool), beside=beside)
    (found,) = defects.reader(one)
    assert (found.kind, found.size, found.weight) == ("reader_skipped", 3.0, 0.03)
    assert "bad checksum" in found.text
    assert "first_byte 77" in found.evidence


def write(path: Path, **columns: object) -> Path:
    pl.DataFrame(columns).write_csv(path)
    return path


def test_log_from_a_table(tmp_path: Path) -> None:
    path = write(
        tmp_path / "log.csv", time_ns=[0, 5, 5], beam1_mps=[0.1, 0.2, None], beam1_valid=[True, True, False],
        instrument_x_mps=[1.0, 2.0, 3.0], instrument_y_mps=[0.0, 0.0, 0.0], instrument_z_mps=[0.0, None, 0.0],
    )  # fmt: skip
    read = read_log(path)
    assert (read.beams, read.pings) == (1, 3)
    assert read.full.tolist() == [True, True, False]
    assert read.solved.tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("time_ns", "mps", "valid", "match"),
    [
        ([0, 1], None, None, "neither beam1_mps"),
        ([0, 1], [1.0, None], [1, 1], "row 1: column 'beam1_mps' is not"),
        ([0, 1], [1.0, 2.0], [1, 2], "row 1: column 'beam1_valid' is 2"),
        ([0, 1], ["a", "2.0"], [1, 1], "row 0: column 'beam1_mps' is 'a'"),
        ([0, None], [1.0, 2.0], [1, 1], "row 1: column 'time_ns' has no time"),
        ([0, 1], [1.0, 2.0], None, "column 'beam1_valid' is missing"),
    ],
)
def test_bad_logs_are_refused(
    tmp_path: Path, time_ns: object, mps: object, valid: object, match: str
) -> None:
    columns = {"time_ns": time_ns, "beam1_mps": mps, "beam1_valid": valid}
    path = write(tmp_path / "log.csv", **{name: of for name, of in columns.items() if of is not None})
    with pytest.raises(DataError, match=match):
        read_log(path)


def test_bad_neighbours_are_refused(tmp_path: Path) -> None:
    columns = {"time_ns": [0, 1], "roll_rad": [0.0, 0.0], "pitch_rad": [0.0, None], "yaw_rad": [0.0, 0.0]}
    path = write(tmp_path / "attitude.csv", **columns)
    with pytest.raises(DataError, match="row 1: column 'pitch_rad' is nan"):
        read_reference(path)
    with pytest.raises(DataError, match="no such file"):
        audit_file(tmp_path / "nowhere.parquet")


def test_beams_and_geometry_that_differ_in_number(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", time_ns=[0, 1], beam1_mps=[1.0, 2.0], beam1_valid=[1, 1])
    with pytest.raises(DataError, match="has 1 beams, expected 4"):
        audit_file(path, geometry="x_janus_20")


def unlocked(y: Array, valid: bool, own_valid: bool | None) -> BeamLog:
    flags = None if own_valid is None else np.full(len(y), own_valid)
    own = None if own_valid is None else np.zeros((len(y), 3))
    return BeamLog("air", np.arange(len(y)) * 10**8, y, np.full(y.shape, valid), own, flags)


@pytest.mark.parametrize(
    "log",
    [
        unlocked(np.random.default_rng(1).normal(size=(300, 4)), valid=True, own_valid=False),
        unlocked(np.full((300, 4), np.nan), valid=False, own_valid=None),
        unlocked(np.zeros((300, 4)), valid=True, own_valid=None),
        unlocked(np.full((300, 4), -10.117), valid=False, own_valid=False),
        unlocked(np.zeros((300, 0)), valid=True, own_valid=None),
    ],
    ids=["noise-in-air", "empty", "zeros", "one-number", "velocity-alone"],
)
def test_a_log_that_never_had_lock(log: BeamLog) -> None:
    for stated in (BeamGeometry.janus(np.deg2rad(22.0)), None):
        (found,) = Audit(log, stated=stated).findings
        assert found.kind == "never_locked"
