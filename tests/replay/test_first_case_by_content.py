"""`replay --init` on tables whose columns have no names or other dates, and on logs that tell little."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.replay.case import load_case
from bottomlock.replay.init.any_table import AnyTable
from bottomlock.replay.init.found import iso_times, table_times
from bottomlock.replay.init.make import make_case
from bottomlock.replay.run import replay_case
from tests.dive import Dive, drawn_dive
from tests.dive_logs import write_a50, write_csv

EPOCH_S = 1_714_564_799.5
ISO = {
    "zone": ["2024-05-01T11:59:59.500Z", "2024-05-01T12:00:00.000Z", "2024-05-01T12:00:01Z"],
    "no zone": ["2024-05-01 11:59:59.5", "2024-05-01 12:00:00", "2024-05-01 12:00:01"],
    "another zone": ["2024-05-01T13:59:59,5+02:00", "2024-05-01T14:00:00+02:00", "2024-05-01T14:00:01+02:00"],
}


@pytest.mark.parametrize("name", list(ISO))
def test_iso_8601_is_recognised(name: str) -> None:
    found = iso_times(pl.Series(ISO[name]))
    assert found is not None
    assert found.tolist() == [round((EPOCH_S + s) * 1e9) for s in (0.0, 0.5, 1.5)]


@pytest.mark.parametrize("cells", [["3.7", "3.8"], ["a", "b"], ["12:30:00", "12:30:01"]])
def test_other_text_is_no_time(cells: list[str]) -> None:
    assert iso_times(pl.Series(cells)) is None


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(3, seconds=120.0)


def imu_table(dive: Dive, start_s: float) -> dict[str, np.ndarray]:
    values = np.column_stack([dive.imu_s + start_s, dive.omega, dive.force])
    return {f"c{k}": column for k, column in enumerate(values.T)}


NAMES = ("t", "wx", "wy", "wz", "ax", "ay", "az")


def imu_file(dive: Dive, path: Path, start_s: float) -> Path:
    return write_csv(path, dict(zip(NAMES, imu_table(dive, start_s).values(), strict=True)))


def test_columns_without_names_are_refused(dive: Dive, tmp_path: Path) -> None:
    """The refusal names the file, shows the first row, and says what to write."""
    imu = imu_file(dive, tmp_path / "imu.csv", 1.7e9)
    imu.write_text(imu.read_text().partition("\n")[2])
    with pytest.raises(DataError) as caught:
        make_case([write_a50(dive, tmp_path / "dvl.json", start_s=1.7e9), imu], tmp_path / "case.toml")
    assert caught.value.place == str(imu)
    assert imu.read_text().partition(",")[0] in str(caught.value)
    assert "ax, ay, az, wx, wy, wz" in caught.value.hint


@pytest.mark.parametrize("day", ["01.05.2024 11:59:59,5", "2024/5/1 11:59:59", "11:59:59.5"])
def test_dates_of_another_kind_are_refused(tmp_path: Path, day: str) -> None:
    table = AnyTable(
        tmp_path / "imu.csv", pl.DataFrame({"x": ["7", "8"], "time": [day, day]}), plain=True, units={}
    )
    with pytest.raises(DataError) as caught:
        table_times(table, "imu")
    assert caught.value.place == str(table.path)
    assert "time" in caught.value.key
    assert day in str(caught.value)
    assert "ISO 8601" in caught.value.expected


def test_what_is_missing_beside_known_columns_is_said(dive: Dive, tmp_path: Path) -> None:
    """A heading without roll and pitch, and a velocity without times."""
    imu = imu_file(dive, tmp_path / "imu.csv", 0.0)
    heading = write_csv(tmp_path / "heading.csv", {"t": dive.imu_s, "heading_deg": dive.imu_s})
    speeds = {f"v{axis}": np.zeros(len(dive.imu_s)) for axis in "xyz"}
    velocity = write_csv(tmp_path / "dvl.csv", speeds)
    for path, found in ((heading, "heading_deg alone"), (velocity, "a velocity and no column of times")):
        with pytest.raises(DataError) as caught:
            make_case([imu, path], tmp_path / "case.toml")
        assert caught.value.place == str(path)
        assert found in str(caught.value)
        assert "time" in caught.value.hint


def test_a_counter_without_the_name_of_a_time_is_none(dive: Dive, tmp_path: Path) -> None:
    """A packet counter rises as a clock does; rows then count as even over the length of the log, which is asked."""
    imu = imu_table(dive, 0.0) | {"c0": np.arange(len(dive.imu_s))}
    path = write_csv(
        tmp_path / "imu.csv", dict(zip(("PacketCounter", *NAMES[1:]), imu.values(), strict=True))
    )
    make_case([write_a50(dive, tmp_path / "dvl.json"), path], tmp_path / "case.toml")
    case = load_case(tmp_path / "case.toml")
    assert case.readings.clock.column is None
    assert "imu.clock" in case.assumed


def blind(dive: Dive) -> Dive:
    """Two beams are lost throughout."""
    beams = dive.beams.copy()
    beams[:, 2:] = np.nan
    return replace(dive, beams=beams)


def silent(dive: Dive) -> Dive:
    """Every beam is lost but in one ping before the start."""
    beams = np.full_like(dive.beams, np.nan)
    beams[0] = dive.beams[0]
    return replace(dive, beams=beams)


@pytest.mark.long
@pytest.mark.parametrize(("lost", "kind"), [(blind, ""), (silent, "no_fix")])
def test_a_log_without_a_whole_velocity_runs(
    dive: Dive, tmp_path: Path, lost: Callable[[Dive], Dive], kind: str
) -> None:
    """Clocks without anything in common are taken to begin together, and the start is not claimed to be at rest."""
    imu = imu_file(dive, tmp_path / "imu.csv", 12.5)
    log = write_a50(lost(dive), tmp_path / "dvl.json", start_s=1.7e9)
    make_case([log, imu], tmp_path / "case.toml")
    case = load_case(tmp_path / "case.toml")
    assert case.dvl.clock.offset_s == pytest.approx(12.5 - 0.3 - 1.7e9, abs=0.02)
    assert case.start.velocity_sd_mps[0] > 1.0
    replayed = replay_case(case)
    assert kind in ["", *(one["kind"] for one in replayed.manifest["findings"][:1])]


def test_noise_is_that_of_the_closure_where_the_geometry_claims_less(tmp_path: Path) -> None:
    """The geometry of the A50 claims 4 mm/s."""
    noisy = drawn_dive(4, seconds=120.0, beam_sd=0.02)
    imu = imu_file(noisy, tmp_path / "imu.csv", 0.0)
    make_case([write_a50(noisy, tmp_path / "dvl.json"), imu], tmp_path / "case.toml")
    assert load_case(tmp_path / "case.toml").dvl.beam_noise_mps == pytest.approx(0.02, rel=0.15)
