"""Valid arguments of the kernel's functions, small enough that a call takes well under a millisecond."""

import functools
from random import Random
from typing import Any

import numpy as np

from bottomlock import kernel
from tests.drawn_log import drawn_log
from tests.oracle import truth
from tests.property import settings

SECONDS, RATE_HZ = 1.0, 20.0
NONE = np.empty(0, dtype=np.int64)
_GEOMETRIES = (
    kernel.BeamGeometry.janus(0.35),
    kernel.BeamGeometry.janus(0.52, configuration="+", lever_arms_p_m=np.tile([-1.8, 0.0, 0.1], (4, 1))),
    kernel.BeamGeometry.from_angles(np.full(3, 0.4), np.array([0.0, 2.1, 4.2])),
    kernel.BeamGeometry(np.array([[0.0, 0.0, 1.0]])),
)


def drawn_geometry(rng: Random) -> kernel.BeamGeometry:
    """Four beams mostly, seldom three or one."""
    return rng.choices(_GEOMETRIES, (6, 3, 2, 1))[0]


@functools.cache
def motion() -> dict[str, np.ndarray[Any, Any]]:
    """A second of a figure-eight at 20 Hz."""
    return truth.make(yaw=truth.figure_eight_yaw, seconds=SECONDS, rate_hz=RATE_HZ)


@functools.cache
def model() -> dict[str, Any]:
    """Table 2 with every sensor."""
    return {
        **settings.table_2(),
        "dvl_outliers": {"outlier_fraction": 0.05, "outlier_factor": 20.0},
        "acoustic_position": {
            "sd_m": 1.0, "sd_per_range": 0.01, "transceiver_t_m": [0.0, 0.0, 0.0], "outlier_fraction": 0.1,
            "outlier_factor": 10.0,
        },
        "thrust": {
            "scale_sd": [0.1, 0.1, 0.0], "true_scale_error": 0.0, "slip_sd_mps": [0.02, 0.03, 0.0], "slip_time_s": 5.0,
            "noise_sd_mps": 0.01,
        },
    }  # fmt: skip


def options(rng: Random) -> dict[str, Any]:
    """Filter options, with every block that the kernel's defaults name."""
    lever = [0.3, 0.0, -0.4]
    return {
        **kernel.DEFAULT_OPTIONS,
        "imu_sampling": rng.choice(("instantaneous", "averaged")),
        "gate": rng.choice(("joint", "per_row", "off")),
        "covariance_period_ns": rng.choice((0, 100_000_000)),
        "information_port": rng.choice(("axes", "full")),
        "estimate_dvl": rng.random() < 0.8,
        "water_track": rng.random() < 0.5,
        "levers": dict.fromkeys(kernel.DEFAULT_OPTIONS["levers"], lever),
        "thrust": rng.choice(("off", "velocity", "all")),
    }


def some_methods(rng: Random) -> list[str]:
    """One or two methods."""
    return [rng.choice(kernel.METHODS) for _ in range(rng.randint(1, 2))]


@functools.cache
def schedule(beams: int) -> dict[str, np.ndarray[Any, Any]]:
    """Every sensor once or more within the motion."""
    epochs = motion()["time_ns"]
    lost = np.ones((4, beams), dtype=bool)
    lost[1, 0] = False
    return {
        "dvl_time_ns": epochs[[4, 8, 12, 16]],
        "beam_valid": lost,
        "depth_time_ns": epochs[5::5],
        "depth_offset_m": np.full(len(epochs[5::5]), 0.01),
        "magnetometer_time_ns": epochs[6::6] + 77,
        "yaw_offset_rad": np.full(len(epochs[6::6]), 0.02),
        "gps_time_ns": epochs[7::7],
        "gps_received": np.array([True, False]),
        "acoustic_position_time_ns": epochs[9::9],
        "acoustic_position_received": np.array([True, True]),
        "sample_time_ns": epochs[[10, 20]],
    }


@functools.cache
def log_and_start(beams: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """The motion as a recorded log, and its start."""
    made = next(geometry for geometry in _GEOMETRIES if geometry.beams == beams)
    plan: Any = schedule(beams)
    run: Any = motion()
    assumed: Any = model()
    streams = kernel.simulate_sensors(made, run, assumed, plan, seed=1, trajectory_key=2, run=0)
    initial = streams["initial"]
    times = streams["magnetometer_time_ns"]
    log = drawn_log(
        streams, "gps", "acoustic_position",
        beam_velocity_mps=np.where(streams["dvl_valid"], streams["dvl_velocity_mps"], np.nan),
        beam_sd_mps=np.full(streams["dvl_valid"].shape, 0.042),
        heading_time_ns=times, heading_rad=np.zeros(len(times)), attitude_time_ns=times,
        attitude_t_p=np.tile([1.0, 0.0, 0.0, 0.0], (len(times), 1)),
        acoustic_position_sd_m=np.full((len(streams["acoustic_position_time_ns"]), 3), 1.0),
    )  # fmt: skip
    start = {
        "time_ns": int(initial["time_ns"]),
        "position_t_m": initial["position_t_m"],
        "attitude_t_p": initial["attitude_t_p"],
        "velocity_p_mps": initial["velocity_p_mps"],
        "accel_bias_p_mps2": np.zeros(3),
        "gyro_bias_p_radps": np.zeros(3),
    }
    return log, start
