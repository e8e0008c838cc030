"""The beam table: what goes in comes out, and a table that is none is rejected by name."""

import hashlib
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.io.beam_table import (
    Account,
    BeamTable,
    Recording,
    read_account,
    read_beam_table,
    write_recording,
)


def small() -> BeamTable:
    """Two pings of three beams; the second has lost a beam and has no verdict."""
    nan = np.nan
    return BeamTable(
        time_ns=np.array([10, 20], dtype=np.int64),
        velocity_mps=np.array([[0.1, 0.2, 0.3], [0.4, nan, 0.6]]),
        valid=np.array([[True, True, True], [True, False, True]]),
        range_m=np.array([[1.0, 2.0, 3.0], [1.0, nan, 3.0]]),
        quality=np.full((2, 3), nan),
        sd_mps=np.array([[0.01, 0.02, 0.03], [nan, nan, nan]]),
        instrument_mps=np.array([[1.0, 0.0, -0.1], [nan, nan, nan]]),
        instrument_valid=np.array([1, -1], dtype=np.int8),
        extra={"heading_rad": np.array([0.5, nan])},
    )


def recording(table: BeamTable) -> Recording:
    """The table with an account of one lost record."""
    account = Account(unit="byte", read=3, kept=table.rows)
    account.skip("bad checksum", 117, "7f 7f")
    return Recording(table, account, frame="ship", clock="UTC", time_of="record", format="pd0")


def test_there_and_back(tmp_path: Path) -> None:
    """Parquet holds null where the record held nothing, and reading gives the same arrays."""
    source, to = tmp_path / "dive.pd0", tmp_path / "beams.parquet"
    source.write_bytes(b"raw")
    write_recording(recording(small()), to, source=source)
    frame = pl.read_parquet(to)
    assert frame["beam2_mps"].to_list() == [0.2, None]
    assert frame["instrument_valid"].to_list() == [True, None]
    assert frame["arrival_ns"].to_list() == [None, None]
    back = read_beam_table(to)
    for name in (
        "time_ns",
        "velocity_mps",
        "valid",
        "range_m",
        "sd_mps",
        "instrument_mps",
        "instrument_valid",
    ):
        np.testing.assert_array_equal(getattr(back, name), getattr(small(), name))
    np.testing.assert_array_equal(back.extra["heading_rad"], small().extra["heading_rad"])
    assert back.arrival_ns is None
    account = read_account(to)
    assert account["skipped"] == {"bad checksum": {"count": 1, "first_byte": 117, "first": "7f 7f"}}
    assert account["source_sha256"] == hashlib.sha256(b"raw").hexdigest()


@pytest.mark.parametrize(
    ("changed", "match"),
    [
        ({"time_ns": [10.0, 20.0]}, "column 'time_ns' is Float64, expected whole numbers"),
        ({"time_ns": [10, None]}, "row 1: column 'time_ns' is empty"),
        ({"time_ns": [10, 10]}, "row 1: column 'time_ns' is 10 ns and repeats the time of row 0"),
        ({"beam2_valid": [1, 2]}, "row 1: column 'beam2_valid' is 2.0, expected 0, 1, true or false"),
        ({"beam3_range_m": ["a", "1.0"]}, "row 0: column 'beam3_range_m' is 'a', expected a number"),
        ({"beam2_valid": [True, True]}, "row 1: column 'beam2_mps' is not finite"),
    ],
)
def test_each_fault_is_named(changed: dict[str, list[object]], match: str) -> None:
    """Of another program's table, or one that was edited."""
    frame = small().to_frame().with_columns(**{name: pl.Series(values) for name, values in changed.items()})
    with pytest.raises(DataError, match=match):
        BeamTable.from_frame(frame, "t")
