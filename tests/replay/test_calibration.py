"""Mounting and clock as states of a replay: the case's keys, the tables, the DVL's file and back."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import ScenarioError
from bottomlock.files.replay_tables import ReplayTables
from bottomlock.io.beams import read_geometry
from bottomlock.kernel.models import DvlModel
from bottomlock.replay.calibration import calibration_words, found, write_calibration
from bottomlock.replay.case import Case, parse_case
from bottomlock.replay.reading import read_streams
from bottomlock.replay.rerun import prepare
from bottomlock.replay.run import replay_case
from tests.oracle.rotations import exp_rotation, matrix_from_euler

CASE = Path(__file__).parents[2] / "data" / "logs" / "robosub" / "case.toml"
OWN = "\n[calibration]\nmounting_sd_deg = 2.0\nclock_sd_s = 0.1\n"


SHORT = "smooth = false\nduration_s = 20.0\n"


def case_of(extra: str = "") -> Case:
    text = CASE.read_text(encoding="utf-8").split("[[what_if]]")[0] + SHORT + extra
    case = parse_case(text, place="case", folder=CASE.parent)
    return case.with_methods(["tc", "lc"])


@pytest.fixture(scope="module")
def replayed() -> ReplayTables:
    return replay_case(case_of(OWN))


def test_the_table(replayed: ReplayTables) -> None:
    table = replayed.calibration
    assert table is not None
    assert table["method"].to_list() == ["tc"] * 5 + ["lc"] * 5
    assert table["parameter"].head(5).to_list() == [
        "mounting_forward", "mounting_right", "mounting_down", "clock_offset", "scale",
    ]  # fmt: skip
    np.testing.assert_allclose(table["prior_sd"].head(5), [2.0, 2.0, 2.0, 0.1, 0.7])
    assert (table["sd"] <= table["prior_sd"] * (1 + 1e-12)).all()
    (first, _) = calibration_words(table, ["tc", "lc"])
    assert first.startswith("calibration by tc: mounting forward")


def test_without_a_prior_there_is_nothing(replayed: ReplayTables) -> None:
    off = replay_case(case_of())
    assert off.calibration is None
    assert off.manifest["options"]["calibration"] == {"mounting_sd_rad": (0.0, 0.0, 0.0), "clock_sd_s": 0.0}
    assert replayed.manifest["options"]["calibration"]["clock_sd_s"] == 0.1
    with pytest.raises(ScenarioError, match="no calibration to write"):
        write_calibration(
            Path("never.toml"), read_geometry(case_of().dvl.geometry), off.calibration, case_of(), force=False
        )


def test_written_and_taken_as_the_prior(replayed: ReplayTables, tmp_path: Path) -> None:
    """The next replay starts where this one ended: mounting and clock as found, with their deviations."""
    case, path = case_of(OWN), tmp_path / "dvl.toml"
    write_calibration(path, read_geometry(case.dvl.geometry), replayed.calibration, case, force=False)
    plain = case_of()
    again = plain.model_copy(update={"dvl": plain.dvl.model_copy(update={"geometry": str(path)})})
    streams = read_streams(again)
    assert replayed.calibration is not None
    rows = replayed.calibration.filter(pl.col("method") == "tc")
    value, sd = rows["value"].to_numpy(), rows["sd"].to_numpy()
    late_s = (streams.beams.time_ns - read_streams(case).beams.time_ns) * 1e-9
    np.testing.assert_allclose(late_s, value[3], atol=1e-4)
    assert any("added to the stamps" in note for note in streams.notes)
    prior = prepare(again, streams).options.calibration
    np.testing.assert_allclose(np.rad2deg(prior.mounting_sd_rad), sd[:3], rtol=1e-3)
    assert prior.clock_sd_s == pytest.approx(sd[3], rel=1e-3)
    assert prepare(again, streams).model.of(DvlModel).scale_factor_sd == pytest.approx(sd[4] / 100, rel=1e-3)
    turned = (
        streams.instrument.geometry.directions_p @ read_geometry(case.dvl.geometry).geometry.directions_p.T
    )
    # By pitch the beams of the x-Janus turn most; the angle is that found.
    angle = np.rad2deg(np.arccos(np.clip(np.diagonal(turned), -1, 1))).max()
    assert 0.5 * np.linalg.norm(value[:3]) < angle <= np.linalg.norm(value[:3]) + 1e-3


def test_a_mounting_is_turned_in_the_platform_axes(tmp_path: Path) -> None:
    """What is found comes after the stated mounting: R = Exp(ψ) R_stated; scale and clock add up with the stated."""
    (tmp_path / "dvl.toml").write_text(
        'configuration = "x"\ntilt_deg = 30.0\nmounting_yaw_deg = 90.0\nbeam_noise_mps = 0.01\n'
        "[calibration]\nclock_offset_s = 0.5\nscale_percent = 1.0\n"
    )
    case = case_of(OWN)
    table = pl.DataFrame(
        {
            "what_if": "recorded", "method": "tc", "value": [2.0, 0.0, 0.0, 0.1, 1.0],
            "sd": [0.1, 0.2, 0.3, 0.01, 0.2], "prior_sd": [1.0, 1.0, 1.0, 0.1, 0.7],
        }
    )  # fmt: skip
    result = found(read_geometry(tmp_path / "dvl.toml"), table, case)
    assert result.mounting_rpy_rad is not None
    turned = matrix_from_euler(*result.mounting_rpy_rad)
    expected = exp_rotation(np.deg2rad([2.0, 0.0, 0.0])) @ matrix_from_euler(0.0, 0.0, np.pi / 2)
    np.testing.assert_allclose(turned, expected, atol=1e-12)
    assert result.scale == pytest.approx(1.01**2 - 1)
    assert result.clock_offset_s == pytest.approx(0.6)
