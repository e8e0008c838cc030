"""Case files of a vehicle without inertial readings: what is needed, what is rejected, in which words."""

from __future__ import annotations

import numpy as np
import pytest

from bottomlock.replay.case import parse_case
from bottomlock.replay.model import imu_model
from bottomlock.replay.stream_sections import ImuFromAttitude

LEAST = """
name = "dive"
[imu]
source = "attitude"
[dvl]
file = "beams.parquet"
geometry = "x_janus_20"
[attitude]
file = "ahrs.csv"
clock = { column = "t" }
roll = "r"
pitch = "p"
yaw = "y"
yaw_sd_deg = 1.8
[start]
level = "attitude"
heading = "attitude"
position_sd_m = [1.0, 1.0, 1.0]
"""


def test_the_least_case() -> None:
    """The reference's error changes by its own size in an hour: 1.8 deg/√h, 0.03 deg/√s; there are no biases."""
    case = parse_case(LEAST, place="case.toml")
    assert isinstance(case.imu, ImuFromAttitude)
    assert case.imu.averaged
    assert set(case.files()) == {"dvl", "attitude"}
    noise = imu_model(case)
    assert np.rad2deg(noise.gyro_noise_rad_rts) == pytest.approx(0.03)
    assert noise.accel_bias_sd_mps2 == noise.gyro_bias_sd_radps == 0.0


def test_stated_noise_counts() -> None:
    stated = "accel_noise_mps_per_rt_h = 1.2\ngyro_noise_deg_per_rt_h = 0.6\n[dvl]"
    noise = imu_model(parse_case(LEAST.replace("[dvl]", f"[imu.errors]\n{stated}", 1), place="case.toml"))
    assert noise.accel_noise_mps_rts == pytest.approx(0.02)
    assert np.rad2deg(noise.gyro_noise_rad_rts) == pytest.approx(0.01)
