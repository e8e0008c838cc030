"""A dive of `rov_dive` as an ArduSub logs it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tests.io import autopilot_logs as logs
from tests.replay.rov_dive import Floats, RovDive

BOOT_S = 30.0
SURFACE_PA, HULL_PA = 101_325.0, 99_000.0


def write_bin(
    dive: RovDive, path: Path, *, dvl: str = "VISO", surfaced_s: float = 5.0, imus: int = 2, units: bool = True,
    visv_body: bool = False, estimate_off_m: float = 0.0,
) -> Path:  # fmt: skip
    """The autopilot's own log: two IMUs, two barometers, the estimate, GPS at the surface, the DVL's velocity."""
    names = ["IMU", "ATT", "BARO", "GPS", "XKF1", *([dvl] if dvl else [])]
    rows: list[tuple[int, bytes]] = []
    for k, (second, w, f) in enumerate(zip(dive.imu_s, dive.omega, dive.force, strict=True)):
        us = _us(second)
        for i in range(imus):
            bias = 0.02 * i
            rows.append((us, logs.record("IMU", us, i, *(w + bias), *f, 0, 0, 25.0, 1, 1, 1000, 1000)))
        if k % 5 == 0:
            roll, pitch, yaw = np.rad2deg(dive.rpy[k])
            angles = [0, round(100 * roll), 0, round(100 * pitch), 0, round(100 * (yaw % 360.0))]
            rows.append((us, logs.record("ATT", us, *angles, 0, 0, 3)))
            north, east, down = dive.position[k]
            rows.append(
                (us, logs.record("BARO", us, 0, 0.0, HULL_PA + 30.0 * np.sin(second / 40.0), 2500, 0.0))
            )
            rows.append(
                (us, logs.record("BARO", us, 1, -down, SURFACE_PA + 1025.0 * 9.80665 * down, 1200, 0.0))
            )
            velocity = Rotation.from_euler("ZYX", dive.rpy[k][::-1]).apply(dive.velocity[k])
            place = (north + estimate_off_m, east, down)
            rows.append((us, logs.record("XKF1", us, 0, 0, 0, 0, *velocity, 0.0, *place, 0, 0, 0, 0)))
            if second < surfaced_s:
                rows.append((us, logs.gps(us, (north, east, 0.0))))
    rows += [(_us(end), row(us=_us(end))) for end, row in _dvl(dive, dvl, body=visv_body)]
    rows.sort(key=lambda one: one[0])
    path.write_bytes(logs.head(names, units=units) + b"".join(row for _, row in rows))
    return path


def _us(second: float) -> int:
    return round((second + BOOT_S) * 1e6)


def whole_pings(dive: RovDive) -> tuple[Floats, Floats]:
    """Times and body velocities of the pings of four beams."""
    from bottomlock.io.beams import read_geometry

    whole = np.isfinite(dive.beams).all(axis=1)
    inverse = np.linalg.pinv(np.asarray(read_geometry(dive.geometry).geometry.directions_p))
    return dive.ping_s[whole], dive.beams[whole] @ inverse.T


def _dvl(dive: RovDive, name: str, *, body: bool) -> list[tuple[float, Callable[..., bytes]]]:
    """What a companion computer sends of the DVL: the displacement since the last ping, or the velocity."""
    seconds, velocity = whole_pings(dive)
    rows: list[tuple[float, Callable[..., bytes]]] = []
    if name == "VISO":
        for k in range(1, len(seconds)):
            dt = seconds[k] - seconds[k - 1]
            moved = 0.5 * (velocity[k] + velocity[k - 1]) * dt

            def row(us: int, moved: Floats = moved, dt: float = dt) -> bytes:
                return logs.record("VISO", us, dt, 0.0, 0.0, 0.0, *moved, 90.0)

            rows.append((float(seconds[k]), row))
    if name == "VISV":
        turned = Rotation.from_euler("ZYX", dive.at(seconds, np.unwrap(dive.rpy, axis=0))[:, ::-1])
        for second, sent in zip(seconds, velocity if body else turned.apply(velocity), strict=True):

            def sent_at(us: int, sent: Any = sent) -> bytes:  # noqa: ANN401
                return logs.record("VISV", us, us, us // 1000, *sent, 0.01, 0, 0)

            rows.append((float(second), sent_at))
    return rows


def write_tlog(
    dive: RovDive, path: Path, *, imu: str = "HIGHRES_IMU", dvl: str = "VISION_POSITION_DELTA"
) -> Path:
    """What a ground station logs of the same dive."""
    vehicle, companion = logs.Station(), logs.Station(255, 197)
    rng = np.random.default_rng(1)
    out: list[tuple[int, bytes]] = []

    def log(station: logs.Station, us: int, name: str, *values: Any) -> None:  # noqa: ANN401
        late = int(rng.integers(0, 20_000))
        out.append((us + late, station.log(us, name, *values, late_us=late)))

    for k, (second, w, f) in enumerate(zip(dive.imu_s, dive.omega, dive.force, strict=True)):
        us = _us(second)
        if k % 50 == 0:
            out.append((us, vehicle.heartbeat(us)))
        if imu == "HIGHRES_IMU":
            log(vehicle, us, imu, us, *f, *w, 0, 0, 0, 1013.0, 0, 0, 20.0, 63, 0)
        elif k % 12 == 0:
            counts = [round(1e3 * x / 9.80665) for x in f] + [round(1e3 * x) for x in w]
            log(vehicle, us, imu, us, *counts, 0, 0, 0, 0, 2000)
        if k % 5 == 0:
            log(vehicle, us, "ATTITUDE", us // 1000, *dive.rpy[k], *w)
            down = dive.position[k][2]
            log(vehicle, us, "SCALED_PRESSURE", us // 1000, HULL_PA / 100.0, 0.0, 2500, 0)
            log(
                vehicle,
                us,
                "SCALED_PRESSURE2",
                us // 1000,
                (SURFACE_PA + 1025 * 9.80665 * down) / 100.0,
                0,
                1200,
                0,
            )
            velocity = Rotation.from_euler("ZYX", dive.rpy[k][::-1]).apply(dive.velocity[k])
            log(vehicle, us, "LOCAL_POSITION_NED", us // 1000, *dive.position[k], *velocity)
    seconds, velocity = whole_pings(dive)
    for k in range(1, len(seconds)):
        dt = seconds[k] - seconds[k - 1]
        us = _us(seconds[k])
        if dvl == "VISION_POSITION_DELTA":
            moved = [float(x) for x in 0.5 * (velocity[k] + velocity[k - 1]) * dt]
            log(companion, us, dvl, us, round(dt * 1e6), [0.0] * 3, moved, 90.0)
        else:
            log(companion, us, dvl, us, *(float(x) for x in velocity[k]), [0.0] * 9, 0)
    out.sort(key=lambda one: one[0])
    path.write_bytes(b"".join(row for _, row in out))
    return path
