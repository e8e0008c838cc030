"""`replay --init` of an autopilot's logs: a case that runs, beside a DVL's log or from the velocities it was sent."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from bottomlock.errors import DataError
from bottomlock.replay.case import Case, load_case
from bottomlock.replay.init.make import make_case
from tests.cli.calls import command
from tests.dive import Dive, drawn_dive
from tests.dive_logs import write_a50
from tests.io.autopilot_logs import BOOT_S, START_S, write_bin, write_tlog
from tests.replay.undiagnosed import tc_row


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(3, seconds=80.0)


def made(folder: Path, *files: Path, without: tuple[str, ...] = ()) -> tuple[Case, str]:
    words = make_case(files, folder / "case.toml", without=without).words
    return load_case(folder / "case.toml"), "\n".join([*words, (folder / "case.toml").read_text()])


def end_m(case: Case) -> tuple[float, dict[str, Any]]:
    """Error at the end against the reference, and the row of the method."""
    row = tc_row(case)
    return float(row["position_final_m"]), row


@pytest.mark.first_cases(2)
def test_a_log_beside_that_of_the_dvl(dive: Dive, tmp_path: Path) -> None:
    """Times by GPS: both clocks are UTC. The outer barometer is the depth, the estimate the reference, so marked."""
    log = write_a50(dive, tmp_path / "dvl.json", start_s=START_S + BOOT_S)
    case, words = made(tmp_path, write_bin(dive, tmp_path / "dive.BIN", dvl=""), log)
    assert case.readings.axes == ("x", "y", "z")
    assert case.dvl.clock.offset_s == 0.0
    depth = pl.read_parquet(tmp_path / "case_depth.parquet")["pressure_pa"].to_numpy()
    np.testing.assert_allclose(depth[0], 101_325.0 + 1025.0 * 9.80665 * dive.position[0, 2], rtol=1e-6)
    assert 'note = "XKF1 0: the autopilot\'s own estimate of the same sensors, not independent"' in words
    assert "not used: imu of IMU 1 of dive.BIN" in words
    error, row = end_m(case)
    assert error < 0.2
    assert row["fixes_rejected"] == 0
    assert 0.3 < row["nis_mean_over_fixes"] / row["nis_degrees_mean_over_fixes"] < 3.0


@pytest.mark.first_cases(2)
@pytest.mark.parametrize("frame", ["VISO", "VISV north east down", "VISV body"])
def test_a_log_with_the_velocities_of_a_dvl(dive: Dive, tmp_path: Path, frame: str) -> None:
    """Displacements over their intervals, or velocities whose axes the accelerometers tell."""
    path = write_bin(dive, tmp_path / "dive.BIN", dvl=frame[:4], visv_body=frame.endswith("body"))
    case, words = made(tmp_path, path)
    told = {"VISO": "dt is taken in seconds", "VISV body": "taken as body axes"}.get(
        frame, "taken as north, east, down"
    )
    assert told in words
    assert case.dvl.source == "velocity"
    velocity = pl.read_parquet(tmp_path / "case_dvl.parquet")
    at = (velocity["time_ns"].to_numpy() * 1e-9) - START_S - BOOT_S
    inside = (at > 1.0) & (at < 78.0)
    body = velocity.select("surge_mps", "sway_mps", "heave_mps").to_numpy()[inside]
    left = body - dive.at(at[inside], dive.velocity)
    assert float(np.sqrt(np.mean(left**2))) < 0.02
    error, row = end_m(case)
    assert error < 0.3
    assert row["fixes_rejected"] == 0


@pytest.mark.first_cases(2)
def test_a_telemetry_log(dive: Dive, tmp_path: Path) -> None:
    pytest.importorskip("pymavlink", reason="needs the extra .[mavlink]")
    case, words = made(tmp_path, write_tlog(dive, tmp_path / "dive.tlog"))
    assert "VISION_POSITION_DELTA: velocity" in words
    error, row = end_m(case)
    assert error < 0.3
    assert row["fixes_rejected"] == 0


@pytest.mark.first_cases(2)
def test_a_telemetry_log_with_slow_inertial_readings(dive: Dive, tmp_path: Path) -> None:
    """They are left out, and made from the attitude."""
    pytest.importorskip("pymavlink", reason="needs the extra .[mavlink]")
    log = write_a50(dive, tmp_path / "dvl.json", start_s=START_S + BOOT_S)
    case, words = made(tmp_path, write_tlog(dive, tmp_path / "dive.tlog", imu="RAW_IMU"), log)
    assert "RAW_IMU comes at 4.17 Hz, too slow to be integrated" in words
    assert 'source = "attitude"' in words
    assert end_m(case)[0] < 0.5


def test_gps_throughout_comes_before_the_estimate(dive: Dive, tmp_path: Path) -> None:
    """Where satellites are seen for most of the time they are the reference: they are independent."""
    _, words = made(tmp_path, write_bin(dive, tmp_path / "dive.BIN", surfaced_s=70.0))
    assert 'latitude = "latitude_deg"' in words.split("[reference]")[1]
    (tmp_path / "short").mkdir()
    _, words = made(tmp_path / "short", write_bin(dive, tmp_path / "short" / "dive.BIN", surfaced_s=5.0))
    assert 'north = "north_m"' in words.split("[reference]")[1]
    assert "[gps]" in words


def test_a_sensor_is_chosen_by_leaving_out_the_other(dive: Dive, tmp_path: Path) -> None:
    path = write_bin(dive, tmp_path / "dive.BIN")
    made(tmp_path, path, without=("IMU 0",))
    gyro = pl.read_parquet(tmp_path / "case_imu.parquet")["gyro_x_radps"].to_numpy()
    np.testing.assert_allclose(gyro, dive.omega[:, 0] + 0.02, atol=1e-6)
    with pytest.raises(
        DataError, match=r"--without is 'IMU2', did you mean 'IMU [01]'\? expected a topic or message of the"
    ):
        make_case([path], tmp_path / "other.toml", without=("IMU2",))
    out = tmp_path / "by_command.toml"
    said = command("replay", "--init", path, "--out", out, "--without", "IMU 0", "--without", "XKF1 0").stdout
    assert "IMU 1: imu" in said
    assert "XKF1" not in said
