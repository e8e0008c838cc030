"""A dive of a small vehicle that turns, surges and rolls, with known truth, as readings of each sensor in SI."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.encoders.ping import Ping
from bottomlock.encoders.registry import encoder
from bottomlock.io.beams import read_geometry

Floats = NDArray[np.float64]
LATITUDE = np.deg2rad(45.0)
EARTH = 7.292115e-5 * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)])
GRAVITY = np.array([0.0, 0.0, 9.8062])


@dataclass(frozen=True, eq=False)
class RovDive:
    """Readings in platform axes (forward, right, down), SI; times in s from 0."""

    geometry: str
    imu_s: Floats
    force: Floats
    omega: Floats
    ping_s: Floats
    beams: Floats
    beam_sd: float
    rpy: Floats
    position: Floats
    velocity: Floats

    def at(self, seconds: Floats, values: Floats) -> Floats:
        """(n, k) values at the times of IMU readings, at other times."""
        return np.stack([np.interp(seconds, self.imu_s, column) for column in values.T], axis=1)


def _wander(
    t: Floats, rng: np.random.Generator, size: float, periods: tuple[float, float], parts: int = 5
) -> Floats:
    low, high = 2.0 * np.pi / periods[1], 2.0 * np.pi / periods[0]
    rates, phases = rng.uniform(low, high, parts), rng.uniform(0.0, 2.0 * np.pi, parts)
    return np.asarray(size * np.sqrt(2.0 / parts) * np.sin(t[:, None] * rates + phases).sum(axis=1))


def rov_dive(
    seed: int,
    *,
    seconds: float = 240.0,
    imu_hz: float = 50.0,
    dvl_hz: float = 4.0,
    geometry: str = "waterlinked_a50",
    beam_sd: float = 0.008,
    gyro_bias: float = np.deg2rad(20.0) / 3600.0,
    lively: float = 1.0,
) -> RovDive:
    """A dive at about half a metre per second; MEMS noise; the vehicle is calm for the first 12 s."""
    rng = np.random.default_rng(seed)
    fine = 4
    t = np.arange(0.0, seconds, 1.0 / (imu_hz * fine))
    ramp = np.clip((t - 12.0) / 5.0, 0.0, 1.0)
    ramp = ramp * ramp * (3.0 - 2.0 * ramp)
    roll = np.deg2rad(1.0) + ramp * _wander(t, rng, np.deg2rad(4.0 * lively), (4.0, 15.0))
    pitch = np.deg2rad(-2.0) + ramp * _wander(t, rng, np.deg2rad(4.0 * lively), (5.0, 20.0))
    yaw = 0.6 + ramp * _wander(t, rng, np.deg2rad(70.0), (25.0, 80.0))
    body = ramp[:, None] * np.stack(
        [0.5 + _wander(t, rng, 0.2 * lively, (6.0, 30.0)), _wander(t, rng, 0.12 * lively, (6.0, 30.0)),
         _wander(t, rng, 0.08 * lively, (6.0, 30.0))], axis=1,
    )  # fmt: skip
    C = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1))
    v_n = C.apply(body)
    dt = t[1] - t[0]
    accel = np.gradient(v_n, dt, axis=0) + 2.0 * np.cross(EARTH, v_n)
    force = C.inv().apply(accel - GRAVITY)
    turns = (C[:-1].inv() * C[1:]).as_rotvec() / dt
    turns = np.vstack([turns[:1], 0.5 * (turns[1:] + turns[:-1]), turns[-1:]])
    omega = turns + C.inv().apply(np.tile(EARTH, (len(t), 1)))
    moved = np.cumsum(0.5 * (v_n[1:] + v_n[:-1]) * dt, axis=0)
    position = np.vstack([np.zeros(3), moved]) + np.array([0.0, 0.0, 3.0])
    k = slice(0, None, fine)
    n = len(t[k])
    imu_force = force[k] + 0.01 * rng.normal(size=(n, 3)) + 9.8e-3 * rng.normal(size=3)
    imu_omega = omega[k] + 5e-4 * rng.normal(size=(n, 3)) + gyro_bias * rng.normal(size=3)
    ping_s = np.arange(0.3, seconds - 0.5, 1.0 / dvl_hz)
    B = np.asarray(read_geometry(geometry).geometry.directions_p)
    v = np.stack([np.interp(ping_s, t, column) for column in body.T], axis=1)
    beams = v @ B.T + beam_sd * rng.normal(size=(len(ping_s), len(B)))
    lost = rng.random(beams.shape) < 0.02
    return RovDive(
        geometry, t[k], imu_force, imu_omega, ping_s, np.where(lost, np.nan, beams), beam_sd,
        np.stack([roll, pitch, yaw], axis=1)[k], position[k], body[k],
    )  # fmt: skip


def write_a50(dive: RovDive, path: Path, *, start_s: float = 0.0) -> Path:
    """The DVL's log in the maker's JSON."""
    geometry = read_geometry(dive.geometry).geometry
    writer = encoder("waterlinked-json", geometry)
    inverse = np.linalg.pinv(np.asarray(geometry.directions_p))
    lines, before = [], 0
    for k, (second, beams) in enumerate(zip(dive.ping_s, dive.beams, strict=True)):
        time_ns = round((second + start_s) * 1e9)
        whole = bool(np.isfinite(beams).all())
        ping = Ping(
            time_ns=time_ns, transmission_ns=time_ns + 60_000_000, interval_ns=0 if k == 0 else time_ns - before,
            number=k + 1, beam_velocity_mps=beams, range_m=np.where(np.isfinite(beams), 4.0, np.nan),
            velocity_p_mps=inverse @ beams if whole else None,
            covariance_m2ps2=np.eye(3) * 1e-4 if whole else None,
        )  # fmt: skip
        before = time_ns
        lines.append(writer.encode(ping))
    path.write_bytes(b"".join(lines))
    return path


def write_csv(path: Path, columns: dict[str, Floats], *, separator: str = ",", digits: int = 9) -> Path:
    """Columns as a logger writes them."""
    pl.DataFrame(columns).write_csv(path, separator=separator, float_precision=digits)
    return path
