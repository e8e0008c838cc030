"""A dive whose truth is known, written out as a careless logger would: odd axes, units, clocks, methods and frames."""

from pathlib import Path

import numpy as np
import polars as pl

from tests.oracle import geodesy, truth
from tests.oracle.rotations import Array, matrix_from_euler, matrix_from_quaternion
from tests.toml_text import toml

SECONDS, RATE_HZ, GRAVITY, LATITUDE_DEG, LONGITUDE_DEG = 60.0, 50.0, 9.8, 32.8, 35.0
LEVER_DVL_M = np.array([-1.0, 0.2, 0.3])
LEVER_REFERENCE_M = np.array([1.5, -0.1, -0.4])
MOUNTING_RPY_DEG = (2.0, -3.0, 40.0)
IMU_MOUNTING_RPY_DEG = (0.0, 0.0, 90.0)
DVL_CLOCK_S, REFERENCE_CLOCK_S = 7.25, -3.5

CASE = toml({
    "": {"name": "synthetic"},
    "origin": {"latitude_deg": 32.8, "longitude_deg": 35.0, "height_m": 12.0, "gravity": 9.8},
    "imu": {
        "file": "imu.csv", "clock": {"column": "t_ms", "unit": "ms"}, "force": ["fa", "fb", "fc"],
        "force_unit": "mg", "omega": ["ga", "gb", "gc"], "omega_unit": "deg/s", "axes": ["x", "-y", "z"],
        "mounting_yaw_deg": 90.0,
    },
    "imu.errors": {
        "accel_bias_mg": 0.01, "gyro_bias_deg_per_h": 0.01, "accel_noise_mps_per_rt_h": 0.001,
        "gyro_noise_deg_per_rt_h": 0.001,
    },
    "dvl": {
        "source": "velocity", "file": "dvl.parquet", "clock": {"column": "time", "unit": "s", "offset_s": -7.25},
        "velocity": ["u", "v", "w"], "velocity_unit": "mm/s", "axes": ["x", "-y", "-z"], "velocity_scale": 1.01,
        "geometry": "dvl.toml",
    },
    "dvl.errors": {"beam_bias_mps": 0.0001, "scale_factor_percent": 0.01},
    "depth": {
        "file": "depth.csv", "clock": {"rate_hz": 4.0}, "column": "altitude_cm", "unit": "cm", "up": True,
        "sd_m": 0.05, "offset_m": 12.0, "lever_arm_m": [0.0] * 3,
    },
    "reference": {
        "file": "reference.csv", "clock": {"column": "t", "unit": "s", "offset_s": 3.5}, "latitude": "lat",
        "longitude": "lon", "height": "height", "lever_arm_m": [1.5, -0.1, -0.4],
        "velocity_ned": ["vn", "ve", "vd"], "roll": "roll", "pitch": "pitch", "yaw": "yaw", "attitude_unit": "deg",
    },
    "start": {
        "level": "reference", "heading": "reference", "position": "reference", "velocity": "reference",
        "position_sd_m": [0.0] * 3, "level_sd_deg": 0.01, "heading_sd_deg": 0.01, "velocity_sd_mps": [0.01] * 3,
    },
})  # fmt: skip
GEOMETRY = toml({
    "": {
        "configuration": "x", "tilt_deg": 25.0, "mounting_roll_deg": 2.0, "mounting_pitch_deg": -3.0,
        "mounting_yaw_deg": 40.0,
        "lever_arms_m": [[-1.0, 0.2, 0.3], [-1.0, 0.2, 0.3], [-1.0, 0.2, 0.3], [-1.0, 0.2, 0.3]],
        "beam_noise_mps": 0.005,
    },
})  # fmt: skip


def motion() -> dict[str, Array]:
    """A figure-eight at 2 m/s."""
    return truth.make(
        yaw=truth.figure_eight_yaw,
        seconds=SECONDS,
        rate_hz=RATE_HZ,
        gravity=GRAVITY,
        latitude_rad=np.deg2rad(LATITUDE_DEG),
    )


def write(folder: Path, extra: str = "") -> Path:
    """The tables, the geometry and the case; returns the case's path."""
    true = motion()
    t = true["time_ns"] * 1e-9
    R = [matrix_from_quaternion(q) for q in true["attitude_t_p"]]
    earth = 7.292115e-5 * np.array([np.cos(np.deg2rad(LATITUDE_DEG)), 0.0, -np.sin(np.deg2rad(LATITUDE_DEG))])
    rate_tp = np.array([w - r.T @ earth for w, r in zip(true["omega_p_radps"], R, strict=True)])

    # Platform = M · flip · sensor, so sensor = flip⁻¹ · Mᵀ · platform.
    M, flip = matrix_from_euler(*np.deg2rad(IMU_MOUNTING_RPY_DEG)), np.diag([1.0, -1.0, 1.0])
    force = true["force_p_mps2"] @ (flip @ M.T).T / 9.80665e-3
    rate = np.rad2deg(true["omega_p_radps"] @ (flip @ M.T).T)
    pl.DataFrame(
        {
            "t_ms": t * 1e3,
            **dict(zip(("fa", "fb", "fc"), force.T, strict=True)),
            **dict(zip(("ga", "gb", "gc"), rate.T, strict=True)),
        }
    ).write_csv(folder / "imu.csv", float_precision=14)

    rows = slice(25, None, 50)  # 1 Hz, half a second after the reference
    C = matrix_from_euler(*np.deg2rad(MOUNTING_RPY_DEG))
    at_dvl = true["velocity_p_mps"] + np.cross(rate_tp, LEVER_DVL_M)
    velocity = 1.01 * (at_dvl @ C)[rows] * [1.0, -1.0, -1.0] * 1e3
    pl.DataFrame({"time": t[rows] + DVL_CLOCK_S, **dict(zip("uvw", velocity.T, strict=True))}).write_parquet(
        folder / "dvl.parquet"
    )

    quarter = np.round(np.arange(0.0, SECONDS, 0.25) * RATE_HZ).astype(int)
    # Height above the ellipsoid is 12 m at the origin, and the sensor says altitude: depth is 12 m less it.
    height = 12.0 - true["position_t_m"][quarter, 2]
    pl.DataFrame({"altitude_cm": 100.0 * height}).write_csv(folder / "depth.csv", float_precision=12)

    each = slice(0, None, 50)
    point = true["position_t_m"] + np.array([r @ LEVER_REFERENCE_M for r in R])
    point_v = true["velocity_p_mps"] + np.cross(rate_tp, LEVER_REFERENCE_M)
    v_t = np.array([r @ v for r, v in zip(R, point_v, strict=True)])[each]
    home = geodesy.ecef(np.deg2rad(LATITUDE_DEG), np.deg2rad(LONGITUDE_DEG), 12.0)
    lat, lon, h = np.array(
        [geodesy.geodetic_of_ned(p, home, LATITUDE_DEG, LONGITUDE_DEG) for p in point[each]]
    ).T
    yaw = np.rad2deg(truth.figure_eight_yaw(t)[0])[each]
    pl.DataFrame(
        {
            "t": t[each] + REFERENCE_CLOCK_S, "lat": np.rad2deg(lat), "lon": np.rad2deg(lon), "height": h,
            "vn": v_t[:, 0], "ve": v_t[:, 1], "vd": v_t[:, 2], "roll": 0.0 * yaw, "pitch": 0.0 * yaw, "yaw": yaw,
        }
    ).write_csv(folder / "reference.csv", float_precision=14)  # fmt: skip
    (folder / "dvl.toml").write_text(GEOMETRY, encoding="utf-8")
    path = folder / "case.toml"
    path.write_text(CASE + extra, encoding="utf-8")
    return path


def replace(path: Path, old: str, new: str) -> Path:
    """The case with a piece of text changed."""
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def rows_of(table: pl.DataFrame, **where: str | float) -> pl.DataFrame:
    """Rows of a table with these values."""
    return table.filter(*(pl.col(key) == value for key, value in where.items()))
