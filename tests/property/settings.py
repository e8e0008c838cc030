"""The kernel's settings as the tests use them: Table 2 of Tal et al. 2017 as PAPER reads it, in SI."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from bottomlock._kernel import ScheduleDict

GRAVITY = 9.8
LATITUDE_RAD = 0.5725
EARTH_RATE = 7.292115e-5
LEVEL = (1.0, 0.0, 0.0, 0.0)


def table_2() -> Any:  # noqa: ANN401 - a dict, which a test may change
    """Every error at the paper's size."""
    return {
        "environment": {
            "latitude_rad": LATITUDE_RAD,
            "gravity_mps2": GRAVITY,
            "earth_rate_radps": EARTH_RATE,
            "earth": "tangent_plane",
        },
        "imu": {
            "accel_noise_mps_rts": 0.0012,
            "gyro_noise_rad_rts": float(np.deg2rad(0.34 / 60)),
            "accel_bias_sd_mps2": 0.5e-3 * 9.80665,
            "gyro_bias_sd_radps": float(np.deg2rad(3 / 3600)),
            "accel_bias_walk_mps2_rts": 1e-5,
            "gyro_bias_walk_radps_rts": float(np.deg2rad(2.8e-5)),
        },
        "dvl": {
            "beam_noise_sd_mps": 0.042,
            "beam_bias_sd_mps": 0.005,
            "beam_bias_walk_mps_rts": 5e-5,
            "scale_factor_sd": 0.007,
            "scale_factor_walk_rts": 5e-5,
        },
        "initial": {
            "position_sd_m": [2.0, 2.0, 2.0],
            "attitude_sd_rad": [0.01, 0.01, 0.02],
            "velocity_sd_mps": [0.05, 0.05, 0.05],
        },
        "depth": {"sd_m": 0.0193, "bias_sd_m": 0.0, "bias_time_s": 21_600.0},
        "magnetometer": {"yaw_sd_rad": 0.1, "roll_pitch_sd_rad": 0.02},
        "heading": {"sd_rad": 0.1},
        "gps": {"position_sd_m": [2.0, 2.0, 4.0], "velocity_sd_mps": [0.1, 0.1, 0.2]},
    }


def noise_densities(model: dict[str, dict[str, float]]) -> tuple[float, ...]:
    """Densities of white noise and random walks in the order of `tests.oracle.error_model.noise_density`."""
    imu, dvl = model["imu"], model["dvl"]
    return (
        imu["accel_noise_mps_rts"],
        imu["gyro_noise_rad_rts"],
        imu["accel_bias_walk_mps2_rts"],
        imu["gyro_bias_walk_radps_rts"],
        dvl["beam_bias_walk_mps_rts"],
        dvl["scale_factor_walk_rts"],
    )


def options(*, exact: bool = False, **changed: Any) -> Any:  # noqa: ANN401 - a dict, with a value of any option
    """The filter's options, with what a test changes; `exact`: of virtual beams."""
    plain: dict[str, Any] = {
        "gate": "off",
        "inflate_after_rejections": 0,
        "gate_probability": 0.997,
        "covariance_period_ns": 100_000_000,
        "imu_sampling": "instantaneous",
        "estimate_dvl": True,
        "assumptions": {
            "virtual_beam_factor": 1.0,
            "exact_virtual_beams": exact,
            "nullified_sway_var_m2ps2": 1e-3,
            "weak_sway_var_m2ps2": 2.0,
        },
        "information_port": "axes",
        "robust": None,
    }
    unknown = set(changed) - set(plain)
    if unknown:
        raise KeyError(f"no such option: {unknown}")
    return plain | changed


def start(
    velocity: ArrayLike = (0.0,) * 3, attitude: ArrayLike = LEVEL, position: ArrayLike = (0.0,) * 3
) -> Any:  # noqa: ANN401
    """Of time 0; level, looking north, at rest and at the origin where nothing else is given."""
    return {"time_ns": 0, "position_t_m": position, "attitude_t_p": attitude, "velocity_p_mps": velocity}


def schedule(seconds: int, *, lost: tuple[int, ...] = (), beams: int = 4) -> ScheduleDict:
    """A ping and a sample a second; beams numbered in `lost` never return."""
    epochs = np.arange(1, seconds + 1, dtype=np.int64) * 1_000_000_000
    valid = np.ones((seconds, beams), dtype=bool)
    valid[:, [beam - 1 for beam in lost]] = False
    none = np.empty(0, dtype=np.int64)
    return {
        "dvl_time_ns": epochs,
        "beam_valid": valid,
        "depth_time_ns": none,
        "magnetometer_time_ns": none,
        "gps_time_ns": none,
        "sample_time_ns": np.concatenate([[0], epochs]),
    }
