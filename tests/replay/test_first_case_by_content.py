"""`replay --init` on tables whose columns have no names or foreign ones, and on logs that tell little."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.replay.case import load_case
from bottomlock.replay.init.dates import written_times
from bottomlock.replay.init.make import make_case
from bottomlock.replay.run import replay_case
from tests.dive import Dive, drawn_dive
from tests.dive_logs import write_a50, write_csv

EPOCH_S = 1_714_564_799.5
TEXT = {
    "iso": {"Zeitstempel": ["2024-05-01T11:59:59.500Z", "2024-05-01T12:00:00.000Z", "2024-05-01T12:00:01Z"]},
    "slashes": {"when": ["2024/5/1 11:59:59.5", "2024/5/1 12:00:00", "2024/5/1 12:00:01"]},
    "day first": {"Zeit": ["01.05.2024 11:59:59,5", "01.05.2024 12:00:00,0", "01.05.2024 12:00:01"]},
    "two columns": {"Datum": ["1.5.2024"] * 3, "Uhr": ["11:59:59.500", "12:00:00.000", "12:00:01.000"]},
}


@pytest.mark.parametrize("name", list(TEXT))
def test_dates_are_recognised_by_their_content(name: str) -> None:
    found = written_times(pl.DataFrame({"x": [1.0, 2.0, 3.0]} | TEXT[name]))
    assert found is not None
    assert found[0].tolist() == [round((EPOCH_S + s) * 1e9) for s in (0.0, 0.5, 1.5)]
    assert found[2]


def test_a_time_of_the_day_goes_on_after_midnight() -> None:
    found = written_times(pl.DataFrame({"clock": ["23:59:59.9", "00:00:00.1", "00:00:00.3"]}))
    assert found is not None
    assert np.diff(found[0]).tolist() == [200_000_000, 200_000_000]
    assert not found[2]


@pytest.mark.parametrize(
    "cells", [["3.7", "3.8"], ["a", "b"], ["2024-05-01", "2024-05-02"], ["12:99:00", "x"]]
)
def test_other_text_is_no_time(cells: list[str]) -> None:
    assert written_times(pl.DataFrame({"x": cells})) is None


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(3, seconds=120.0)


def imu_table(dive: Dive, start_s: float) -> dict[str, np.ndarray]:
    values = np.column_stack([dive.imu_s + start_s, dive.omega, dive.force])
    return {f"c{k}": column for k, column in enumerate(values.T)}


def without_header(path: Path) -> Path:
    path.write_text(path.read_text().partition("\n")[2])
    return path


def test_an_imu_without_names_is_known_by_gravity(dive: Dive, tmp_path: Path) -> None:
    """Time, rates, forces; the depth by the name of its file."""
    imu = without_header(write_csv(tmp_path / "imu.csv", imu_table(dive, 1.7e9)))
    depth = {"t": dive.imu_s[::10] + 1.7e9, "d": dive.position[::10, 2]}
    log = write_a50(dive, tmp_path / "dvl.json", start_s=1.7e9)
    make_case([log, imu, without_header(write_csv(tmp_path / "depth.csv", depth))], tmp_path / "case.toml")
    assert "have the size of gravity" in (tmp_path / "case.toml").read_text().replace("\n#  ", "")
    case = load_case(tmp_path / "case.toml")
    assert case.readings.force == ("force_x", "force_y", "force_z")
    assert case.depth is not None
    assert replay_case(case.with_methods(["tc"])).manifest["findings"][0]["severity"] == "note"


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
@pytest.mark.parametrize(("lost", "kind"), [(blind, "verdict"), (silent, "no_fix")])
def test_a_log_without_a_whole_velocity_runs(
    dive: Dive, tmp_path: Path, lost: Callable[[Dive], Dive], kind: str
) -> None:
    """Clocks without anything in common are taken to begin together, and the start is not claimed to be at rest."""
    imu = write_csv(
        tmp_path / "imu.csv",
        dict(zip(["t", "wx", "wy", "wz", "ax", "ay", "az"], imu_table(dive, 12.5).values(), strict=True)),
    )
    log = write_a50(lost(dive), tmp_path / "dvl.json", start_s=1.7e9)
    make_case([log, imu], tmp_path / "case.toml")
    case = load_case(tmp_path / "case.toml")
    assert case.dvl.clock.offset_s == pytest.approx(12.5 - 0.3 - 1.7e9, abs=0.02)
    assert case.start.velocity_sd_mps[0] > 1.0
    replayed = replay_case(case)
    assert replayed.manifest["findings"][0]["kind"] == kind


def test_noise_is_that_of_the_closure_where_the_geometry_claims_less(tmp_path: Path) -> None:
    """The geometry of the A50 claims 4 mm/s."""
    noisy = drawn_dive(4, seconds=120.0, beam_sd=0.02)
    imu = without_header(write_csv(tmp_path / "imu.csv", imu_table(noisy, 0.0)))
    make_case([write_a50(noisy, tmp_path / "dvl.json"), imu], tmp_path / "case.toml")
    assert load_case(tmp_path / "case.toml").dvl.beam_noise_mps == pytest.approx(0.02, rel=0.15)
