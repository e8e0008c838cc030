"""Acoustic position fixes in the kernel and in replay: the printed equations, gate, cases, bad input."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.kernel import KernelError, Navigator
from bottomlock.replay import rerun
from bottomlock.replay.case import parse_case
from bottomlock.replay.reading import read_streams
from tests.kernel.test_replay_log import JANUS, START
from tests.oracle import acoustic_position as oracle
from tests.oracle import kalman
from tests.oracle.rotations import matrix_from_euler, quaternion_from_euler
from tests.property import settings
from tests.replay.test_replay_reading import CASE, tables

MODEL: dict[str, Any] = {
    "sd_m": 0.5,
    "sd_per_range": 0.02,
    "transceiver_t_m": [40.0, -30.0, 5.0],
    "outlier_fraction": 0.0,
    "outlier_factor": 10.0,
}
LEVER = [0.8, -0.3, 0.6]


def model(**changed: Any) -> Any:  # noqa: ANN401 - the kernel's dict
    """Table 2 with an acoustic positioning system."""
    return settings.table_2() | {"acoustic_position": MODEL | changed}


def options(**changed: Any) -> Any:  # noqa: ANN401 - the kernel's dict
    return settings.options(**changed) | {"levers": {"acoustic_position_p_m": LEVER}}


@pytest.mark.parametrize("pitch_deg", [0.0, 20.0, 89.9, 90.0, -90.0])
def test_update_is_the_textbook_filter(pitch_deg: float) -> None:
    """Innovation, its covariance, and state and covariance after, from the equations with dense matrices.

    The yaw is certain enough for a fix to be linearised once.
    """
    rng = np.random.default_rng(5)
    rotation = matrix_from_euler(0.4, np.deg2rad(pitch_deg), -1.1)
    position, fix = np.array([10.0, -5.0, 30.0]), np.array([12.0, -6.5, 29.0])
    root = rng.normal(size=(20, 20)) * 0.1
    root[3:6] *= 0.1
    before = root @ root.T + 0.01 * np.eye(20)
    initial: Any = settings.start(
        attitude=quaternion_from_euler(0.4, np.deg2rad(pitch_deg), -1.1), position=position
    )
    known = {"initial": settings.table_2()["initial"] | {"position_sd_m": [0.2, 0.1, 2.0]}}
    navigator = Navigator(JANUS, model() | known, options(), initial, method="ins", covariance=before)
    navigator.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -9.8])
    (report,) = navigator.push_acoustic_position(time_ns=0, position_t_m=fix)
    lever, transceiver = np.array(LEVER), np.array(MODEL["transceiver_t_m"])
    H = oracle.jacobian(rotation, lever)
    R = oracle.deviation(fix, transceiver, MODEL["sd_m"], MODEL["sd_per_range"]) ** 2 * np.eye(3)
    residual = fix - oracle.expected_fix(position, rotation, lever)
    error, after, H = kalman.update_position(np.zeros(20), before, H, R, residual, 0.2**2 + 0.1**2)
    assert (report.sensor, report.verdict, report.degrees) == ("acoustic_position", "accepted", 3)
    np.testing.assert_allclose(report.residual, residual, atol=1e-12)
    np.testing.assert_allclose(report.covariance, H @ before @ H.T + R, atol=1e-12)
    assert report.nis == pytest.approx(kalman.nis(H, before, R, residual), rel=1e-10)
    np.testing.assert_allclose(navigator.covariance(), after, atol=1e-10)
    np.testing.assert_allclose(navigator.state()["position_t_m"], position + error[:3], atol=1e-10)


def test_it_does_not_collide_with_gps() -> None:
    """A GPS position and an acoustic fix of one time are both taken; each stream has its own order and count."""
    navigator = Navigator(JANUS, model(), options(), START, method="ins")
    place: Any = START["position_t_m"]
    navigator.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -9.8])
    reports = navigator.push_position(0, place, position_sd_m=[2.0, 2.0, 4.0])
    reports += navigator.push_acoustic_position(time_ns=0, position_t_m=place)
    assert [report.sensor for report in reports] == ["gps_position", "acoustic_position"]
    with pytest.raises(KernelError, match="acoustic_position time 0 ns does not come after 0 ns"):
        navigator.push_acoustic_position(time_ns=0, position_t_m=place)
    counts = navigator.late_events()
    assert (counts["acoustic_position"], counts["gps"]) == (1, 0)


def test_without_a_model_a_fix_brings_its_own_deviation() -> None:
    """A model without the section knows no noise; nothing is assumed in its place."""
    navigator = Navigator(JANUS, settings.table_2(), settings.options(), START, method="tc")
    navigator.push_imu(0, omega_p_radps=np.zeros(3), force_p_mps2=[0.0, 0.0, -9.8])
    place: Any = START["position_t_m"]
    with pytest.raises(KernelError, match="acoustic_position sd_m is 0, expected a finite number > 0"):
        navigator.push_acoustic_position(time_ns=0, position_t_m=place)
    (report,) = navigator.push_acoustic_position(time_ns=0, position_t_m=place, sd_m=[1.0, 1.0, 1.0])
    assert report.verdict == "accepted"


def test_case_section_reaches_the_kernel(tmp_path: Path) -> None:
    """Metres of a CSV, with deviations in columns or from the slant range; lever arm and model in SI."""
    tables(tmp_path)
    table = {"t": [0.5, 1.5, 2.5], "n": [1.0, 2.0, 3.0], "e": [0.0, 0.1, 0.2], "d": [5.0, 5.0, 5.1]}
    sds = {"sn": [0.4, 0.5, 0.6], "se": [0.4, 0.5, 0.6], "sd": [1.0, 1.0, 1.0]}
    pl.DataFrame(table | sds).write_csv(tmp_path / "usbl.csv")
    section = """
[acoustic_position]
file = "usbl.csv"
clock = { column = "t" }
north = "n"
east = "e"
down = "d"
lever_arm_m = [0.8, -0.3, 0.6]
sd_percent_of_range = 2.0
transceiver_m = [10.0, 0.0, 0.0]
"""
    start = CASE.replace("position_sd_m = [0.0, 0.0, 0.0]", "position_sd_m = [10.0, 10.0, 10.0]")
    for columns in (False, True):
        text = start + section + ('sd = ["sn", "se", "sd"]\n' if columns else "")
        case = parse_case(text, place="case", folder=tmp_path)
        assert case.files()["acoustic_position"] == tmp_path / "usbl.csv"
        prepared = rerun.prepare(case, read_streams(case))
        log = rerun.kernel_log(case, prepared, prepared.streams.beams.valid[prepared.pings])
        assert (log["acoustic_position_time_ns"] / 1e9).tolist() == [0.5, 1.5, 2.5]
        assert log["acoustic_position_t_m"].tolist() == [[1.0, 0.0, 5.0], [2.0, 0.1, 5.0], [3.0, 0.2, 5.1]]
        assert ("acoustic_position_sd_m" in log) == columns
        assert prepared.options.levers.acoustic_position_p_m == tuple(LEVER)
        assert prepared.model.acoustic_position is not None
        assert prepared.model.acoustic_position.sd_per_range == pytest.approx(0.02)
        assert prepared.model.acoustic_position.transceiver_t_m == (10.0, 0.0, 0.0)
        rerun_result = rerun.run_methods(case, prepared, None)
        # The transponder is 0.6 m below the IMU.
        assert rerun_result.result["position_t_m"][0, -1, 2] == pytest.approx(5.0 - 0.6, abs=0.3)
