"""Logs with known noise for the tests of `bottomlock tune`: arrays, and case folders."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.kernel import EARTH_RATE_RADPS, BeamGeometry
from tests.toml_text import toml

GRAVITY, LATITUDE_RAD = 9.8, 0.7
TILT_RAD = np.deg2rad(30.0)

AUTOPILOT: dict[str, float] = {
    "accel_noise": 2e-3, "gyro_noise": 2e-4, "accel_walk": 2e-5, "gyro_walk": 2e-6, "accel_bias": 2e-2,
    "gyro_bias": 2e-4, "beam_noise": 0.02, "beam_bias": 0.003, "scale": 0.003, "tilt": 0.01, "yaw": 0.02,
}  # fmt: skip
"""1 sigma in SI: noise per √s, walks per √s, biases."""
TACTICAL: dict[str, float] = AUTOPILOT | {
    "accel_noise": 3e-4, "gyro_noise": 2e-5, "accel_walk": 2e-6, "gyro_walk": 1e-7, "accel_bias": 3e-3,
    "gyro_bias": 5e-6, "beam_noise": 0.008, "tilt": 0.003, "yaw": 0.01,
}  # fmt: skip
COARSE: dict[str, float] = AUTOPILOT | {
    "accel_noise": 2e-2, "gyro_noise": 2e-3, "accel_walk": 1e-4, "gyro_walk": 1e-5, "beam_noise": 0.06, "tilt": 0.02,
    "yaw": 0.04,
}  # fmt: skip
KINDS = (AUTOPILOT, TACTICAL, COARSE)


@dataclass(frozen=True, eq=False)
class Dive:
    """A simulated dive: its arrays by sensor and quantity, SI, and the noise that made them."""

    log: dict[str, Any]
    noise: Mapping[str, float]


def walk(rng: np.random.Generator, count: int, width: int, sd: float, step_s: float) -> NDArray[np.float64]:
    """A random walk of `sd` per √s, (count, width)."""
    return np.cumsum(rng.normal(0.0, sd * np.sqrt(step_s), (count, width)), axis=0)


def dive(
    seed: int,
    noise: Mapping[str, float] = AUTOPILOT,
    *,
    seconds: float = 420.0,
    rate_hz: float = 20.0,
    attitude_hz: float = 2.0,
) -> Dive:
    """A vehicle that turns and changes its speed.

    Args:
        seed: of everything random.
        noise: 1 sigma of the errors.
        seconds, rate_hz, attitude_hz: length, and rates of IMU and attitude; that of the DVL is 2 Hz.
    """
    rng = np.random.default_rng(seed)
    step_s = 1.0 / rate_hz
    t = np.arange(int(seconds * rate_hz) + 1) * step_s
    count = len(t)
    phase = rng.uniform(0.0, 2.0 * np.pi, 7)
    yaw = 0.8 * np.sin(2 * np.pi * t / 140 + phase[0]) + 1.2 * np.sin(2 * np.pi * t / 370 + phase[1])
    rpy = np.stack(
        [0.03 * np.sin(2 * np.pi * t / 7 + phase[2]), 0.04 * np.sin(2 * np.pi * t / 11 + phase[3]), yaw],
        axis=1,
    )
    attitude = Rotation.from_euler("ZYX", rpy[:, ::-1])
    velocity_p = np.stack(
        [
            0.7 + 0.2 * np.sin(2 * np.pi * t / 50 + phase[4]),
            0.15 * np.sin(2 * np.pi * t / 23 + phase[5]),
            0.05 * np.sin(2 * np.pi * t / 31 + phase[6]),
        ],
        axis=1,
    )
    velocity_t = attitude.apply(velocity_p)
    # Readings are means over the step that they end.
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / step_s
    middle = attitude[:-1] * Rotation.from_rotvec(turned * step_s / 2)
    earth = EARTH_RATE_RADPS * np.array([np.cos(LATITUDE_RAD), 0.0, -np.sin(LATITUDE_RAD)])
    coriolis = 2.0 * np.cross(earth, velocity_t[1:])
    force = middle.inv().apply(np.diff(velocity_t, axis=0) / step_s + coriolis - [0.0, 0.0, GRAVITY])
    rate = turned + middle.inv().apply(np.tile(earth, (count - 1, 1)))
    force, rate = np.vstack([force[:1], force]), np.vstack([rate[:1], rate])
    force += rng.normal(0.0, noise["accel_bias"], 3) + walk(rng, count, 3, noise["accel_walk"], step_s)
    rate += rng.normal(0.0, noise["gyro_bias"], 3) + walk(rng, count, 3, noise["gyro_walk"], step_s)
    force += rng.normal(0.0, noise["accel_noise"] / np.sqrt(step_s), (count, 3))
    rate += rng.normal(0.0, noise["gyro_noise"] / np.sqrt(step_s), (count, 3))
    pings = np.arange(int(rate_hz / 2.0), count, int(rate_hz / 2.0))
    beams = (
        velocity_p[pings]
        @ np.asarray(BeamGeometry.janus(TILT_RAD).directions_p).T
        * (1.0 + rng.normal(0.0, noise["scale"]))
    )
    beams += rng.normal(0.0, noise["beam_bias"], 4) + rng.normal(0.0, noise["beam_noise"], beams.shape)
    sensed = np.arange(int(rate_hz / attitude_hz), count, int(rate_hz / attitude_hz))
    scatter = np.array([noise["tilt"], noise["tilt"], noise["yaw"]])
    time_ns = np.round(t * 1e9).astype(np.int64)
    log = {
        "imu_time_ns": time_ns,
        "force_p_mps2": force,
        "omega_p_radps": rate,
        "dvl_time_ns": time_ns[pings],
        "beam_velocity_mps": beams,
        "attitude_time_ns": time_ns[sensed],
        "rpy_rad": rpy[sensed] + rng.normal(0.0, 1.0, (len(sensed), 3)) * scatter,
    }
    return Dive(log, dict(noise))


ACCEL_KEY, GYRO_KEY = "imu.errors.accel_noise_mps_per_rt_h", "imu.errors.gyro_noise_deg_per_rt_h"
BEAM_KEY = "dvl.beam_noise_mps"


def case_values(noise: Mapping[str, float]) -> dict[str, float]:
    """The keys of a case for the noise of inertial readings and beams."""
    return {
        ACCEL_KEY: noise["accel_noise"] * 60.0,
        GYRO_KEY: float(np.rad2deg(noise["gyro_noise"]) * 60.0),
        BEAM_KEY: noise["beam_noise"],
    }


def write_case(folder: Path, dived: Dive, factors: Mapping[str, float] | None = None) -> Path:
    """The dive as a case folder, whose noise is wrong by factors by their keys."""
    log, noise = dived.log, dived.noise
    values = {key: value * (factors or {}).get(key, 1.0) for key, value in case_values(noise).items()}
    columns = {"fx": log["force_p_mps2"], "wx": log["omega_p_radps"]}
    imu = {"time_ns": log["imu_time_ns"]} | {
        f"{name[0]}{axis}": array[:, k] for name, array in columns.items() for k, axis in enumerate("xyz")
    }
    pl.DataFrame(imu).write_parquet(folder / "imu.parquet")
    beams = {"time_ns": log["dvl_time_ns"]}
    for k, velocity in enumerate(log["beam_velocity_mps"].T):
        beams |= {f"beam{k + 1}_mps": velocity, f"beam{k + 1}_valid": np.ones(len(velocity), dtype=bool)}
    pl.DataFrame(beams).write_parquet(folder / "beams.parquet")
    angles = dict(zip(("roll", "pitch", "yaw"), log["rpy_rad"].T, strict=True))
    pl.DataFrame({"time_ns": log["attitude_time_ns"]} | angles).write_parquet(folder / "attitude.parquet")
    (folder / "dvl.toml").write_text(
        f'configuration = "x"\ntilt_deg = 30.0\nbeam_noise_mps = {noise["beam_noise"]}\n', encoding="utf-8"
    )
    text = toml({
        "": {"name": "known"},
        "origin": {"latitude_deg": np.rad2deg(LATITUDE_RAD), "gravity": 9.8},
        "imu": {
            "file": "imu.parquet", "clock": {"column": "time_ns", "unit": "ns"}, "force": ["fx", "fy", "fz"],
            "omega": ["wx", "wy", "wz"], "sampling": "averaged",
        },
        "imu.errors": {
            "accel_bias_mg": noise["accel_bias"] / 9.80665e-3,
            "gyro_bias_deg_per_h": np.rad2deg(noise["gyro_bias"]) * 3600.0,
            "accel_noise_mps_per_rt_h": values[ACCEL_KEY], "gyro_noise_deg_per_rt_h": values[GYRO_KEY],
        },
        "dvl": {"file": "beams.parquet", "geometry": "dvl.toml", "beam_noise_mps": values[BEAM_KEY]},
        "dvl.errors": {
            "beam_bias_mps": noise["beam_bias"], "beam_bias_walk_mps_per_rt_s": 0.0,
            "scale_factor_percent": 100.0 * noise["scale"], "scale_factor_walk_percent_per_rt_s": 0.0,
        },
        "attitude": {
            "file": "attitude.parquet", "clock": {"column": "time_ns", "unit": "ns"}, "roll": "roll",
            "pitch": "pitch", "yaw": "yaw", "aids": "attitude", "roll_pitch_sd_deg": np.rad2deg(noise["tilt"]),
            "yaw_sd_deg": np.rad2deg(noise["yaw"]),
        },
        "start": {
            "at_s": 2.0, "level": "attitude", "heading": "attitude", "position_sd_m": [0.0] * 3,
            "velocity": "beams",
        },
        "replay": {"methods": ["tc"], "smooth": False},
    })  # fmt: skip
    text = re.sub(r"(?m)^(\w+_noise_\w+_per_rt_h = .*)$", r"\1  # guessed", text)
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path
