"""A vehicle whose solved velocities are wrong for a while, or whose filter was thrown off while they are right.

A turn of 3°/s at 1.5 m/s, readings of the IMU with the errors that the filter assumes, a solved velocity at some rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bottomlock
from tests.property import settings

JANUS = bottomlock.BeamGeometry.janus(np.deg2rad(20.0))
IMU_HZ, SECONDS, FROM_S = 100, 120.0, 40.0
RATE_RADPS, VELOCITY_MPS = np.array([0.0, 0.0, np.deg2rad(3.0)]), np.array([1.5, 0.0, 0.0])
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Flown:
    """Times of the readings, s from the first wrong one (n,), errors and claimed sigma of the velocity, m/s (n, 3)."""

    time_s: Floats
    error_mps: Floats
    sd_mps: Floats

    def worst(self, first_s: float, last_s: float) -> float:
        """The greatest error over its sigma of any axis from one time to another."""
        rows = (self.time_s >= first_s) & (self.time_s <= last_s)
        return float(np.max(np.abs(self.error_mps[rows]) / self.sd_mps[rows]))

    def largest_mps(self, first_s: float, last_s: float) -> float:
        """The greatest norm of the error from one time to another."""
        rows = (self.time_s >= first_s) & (self.time_s <= last_s)
        return float(np.max(np.linalg.norm(self.error_mps[rows], axis=1)))


def flown(
    seed: int,
    offsets_mps: Floats,
    *,
    hz: float = 1.0,
    sd_mps: float = 0.02,
    thrown_mps: Floats | None = None,
) -> Flown:
    """A run in which so many readings in a row (n, 3), m/s, are off, and the filter is thrown off at `FROM_S`."""
    rng = np.random.default_rng(seed)
    model = settings.table_2()
    model["environment"]["earth_rate_radps"] = 0.0
    imu, start = model["imu"], model["initial"]
    start["velocity_sd_mps"] = np.full(3, 0.05)
    tilt = rng.standard_normal(3) * start["attitude_sd_rad"]
    half = 0.5 * tilt
    initial: Any = {
        "time_ns": 0,
        "position_t_m": np.zeros(3),
        "attitude_t_p": np.array([1.0, *half]) / np.sqrt(1.0 + half @ half),
        "velocity_p_mps": VELOCITY_MPS + rng.standard_normal(3) * 0.05,
    }
    nav = bottomlock.Navigator(
        JANUS, model, settings.options(gate="joint", inflate_after_rejections=5), initial, method="tc"
    )
    bias_f, bias_w = (
        rng.standard_normal(3) * imu[key] for key in ("accel_bias_sd_mps2", "gyro_bias_sd_radps")
    )
    force = np.cross(RATE_RADPS, VELOCITY_MPS) - np.array([0.0, 0.0, settings.GRAVITY])
    scale = np.sqrt(float(IMU_HZ))
    every, count = round(IMU_HZ / hz), len(offsets_mps)
    times, errors, sds = [], [], []
    first = round(FROM_S * IMU_HZ) // every
    for k in range(1, int(SECONDS * hz) + 1):
        steps = np.arange((k - 1) * every + (k > 1), k * every + 1)
        noise_f, noise_w = rng.standard_normal((2, len(steps), 3))
        readings = force + bias_f + imu["accel_noise_mps_rts"] * scale * noise_f
        if thrown_mps is not None:
            # What the filter is told of a motion that is not there, within the last second before.
            pushed = (steps > first * every - IMU_HZ) & (steps <= first * every)
            readings = readings + pushed[:, None] * thrown_mps
        nav.push_imu_block(
            time_ns=steps * (10**9 // IMU_HZ),
            omega_p_radps=RATE_RADPS + bias_w + imu["gyro_noise_rad_rts"] * scale * noise_w,
            force_p_mps2=readings,
        )
        wrong = offsets_mps[k - first - 1] if 0 <= k - first - 1 < count else np.zeros(3)
        time_ns, velocity = k * every * (10**9 // IMU_HZ), VELOCITY_MPS + wrong
        reading = velocity + sd_mps * rng.standard_normal(3)
        nav.push_velocity(time_ns, velocity_p_mps=reading, cov_m2ps2=np.eye(3) * sd_mps**2)
        state = nav.state()
        times.append((k - first - 1) / hz)
        errors.append(np.asarray(state["velocity_p_mps"]) - VELOCITY_MPS)
        sds.append(np.sqrt(np.diag(nav.covariance())[6:9]))
    return Flown(np.array(times), np.array(errors), np.array(sds))
