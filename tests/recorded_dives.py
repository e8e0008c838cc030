"""Two recorded dives as their users would hold them, in CSV files.

Nothing of them may be republished, so the tables are written where the caller says and never into the project.

- `stpere`: MTi AHRS, three-beam DVL (beams and velocity) and DGPS of the AUV Ictineu (Ribas et al. 2008), in
  vehicle axes (forward, right, down), and the readings of the MTi in its own axes in `mti.csv`.
- `glider`: attitude, depth, DVL (beams and velocity), water profile and GPS of a Slocum glider; it has no inertial
  readings.
"""

from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.files.atomic_write import write_parquet
from bottomlock.io.beam_table import WaterTable, water_file

MTI_TO_VEHICLE = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Found in the recording: x_v = -y, y_v = x, z_v = z."""
DVL_YAW_DEG = 70.2
"""Found in the recording, which documents 60: fitted to DGPS, the compass included."""
ARGONAUT_TILT_DEG = 25.0
PATHFINDER_TILT_DEG = 30.0
PROFILE_CELLS = 10
"""Of 40; the others are beyond the bottom."""
GLIDER_CLOCK_S = 3593.0
"""Found in the recording: the depths of the two logs then correlate by 0.9995."""


def numbers(path: Path, columns: int) -> np.ndarray:
    """Rows of so many numbers of a log; comments and damaged rows are left out."""
    lines = path.read_text(encoding="latin-1").splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.startswith("%")]
    return np.array([[float(value) for value in row[:columns]] for row in rows if len(row) >= columns])


def degrees(dm: np.ndarray) -> np.ndarray:
    """Degrees of ddmm.mmmm."""
    whole = np.floor(dm / 100.0)
    return whole + (dm - 100.0 * whole) / 60.0


def write(folder: Path, name: str, columns: dict[str, np.ndarray]) -> None:
    """A CSV table; NaN as an empty cell."""
    pl.DataFrame(columns).fill_nan(None).write_csv(folder / f"{name}.csv")


def stpere(data: Path, out: Path) -> None:
    """The tables of St Pere, in `out`."""
    source = data / "stpere_ictineu"
    out.mkdir(parents=True, exist_ok=True)
    mti = numbers(source / "_040825_1735_MTI.log", 10)
    time_s, rpy_deg, rate, force = mti[:, 0], mti[:, 1:4], mti[:, 4:7], mti[:, 7:10]
    axes = ("x", "y", "z")
    own = {f"gyr_{axis}": rate[:, k] for k, axis in enumerate(axes)} | {
        f"acc_{axis}": force[:, k] for k, axis in enumerate(axes)
    }
    angles = dict(zip(("roll", "pitch", "yaw"), rpy_deg.T, strict=True))
    write(out, "mti", {"time": time_s} | angles | own)
    rate_v, force_v = rate @ MTI_TO_VEHICLE.T, force @ MTI_TO_VEHICLE.T
    imu = {f"gyr_{axis}": rate_v[:, k] for k, axis in enumerate(axes)} | {
        f"acc_{axis}": force_v[:, k] for k, axis in enumerate(axes)
    }
    write(out, "imu", {"time": time_s} | imu)
    yaw_deg = (rpy_deg[:, 2] - 90.0 + 180.0) % 360.0 - 180.0
    write(out, "ahrs", {"time": time_s, "roll": -rpy_deg[:, 1], "pitch": rpy_deg[:, 0], "yaw": yaw_deg})
    dvl = numbers(source / "_040825_1735_DVL.log", 18)
    valid = dvl[:, 14] == 1
    velocity = dvl[:, 11:14] * 0.01 * [1.0, -1.0, -1.0]
    turn = Rotation.from_euler("z", DVL_YAW_DEG, degrees=True)
    velocity_v = np.where(valid[:, None], turn.apply(velocity), np.nan)
    ranges = np.where(dvl[:, 15:18] > 0.0, dvl[:, 15:18], np.nan)
    write(
        out,
        "dvl",
        {"time": dvl[:, 0]}
        | {f"v{axis}": velocity_v[:, k] for k, axis in enumerate(axes)}
        | {f"range_{k + 1}": ranges[:, k] for k in range(3)},
    )
    # Towards the transducer positive: three beams at 0, 120, 240 degrees of the instrument.
    azimuth = np.radians([0.0, 120.0, 240.0])
    tilt = np.radians(ARGONAUT_TILT_DEG)
    beams = np.stack(
        [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(3, np.cos(tilt))], 1
    )
    radial = np.where(valid[:, None], velocity @ beams.T, np.nan)
    write(
        out,
        "dvl_beams",
        {"time": dvl[:, 0]}
        | {f"beam{k + 1}_mps": radial[:, k] for k in range(3)}
        | {f"beam{k + 1}_range_m": ranges[:, k] for k in range(3)},
    )
    gps = numbers(source / "_040825_1735_DGPS.log", 4)
    write(out, "gps", {"time": gps[:, 0], "latitude": degrees(gps[:, 1]), "longitude": degrees(gps[:, 2])})


def glider(data: Path, out: Path) -> None:
    """The tables of the glider, in `out`, on the clock of its own log.

    The ensembles' stamps are 3,593 s behind it, by their depths. Their attitude was added by those stamps, so it is
    that of another hour; the glider's own log has the right one, which turns earth components into vehicle axes.
    """
    source = data / "glider_pathfinder"
    out.mkdir(parents=True, exist_ok=True)
    own = pl.read_csv(source / "dbd_apr10.csv", infer_schema_length=None)
    own_s = own["time"].to_numpy()
    rpy = own.select("m_roll", "m_pitch", "m_heading").to_numpy()
    angles = dict(zip(("roll", "pitch", "heading"), np.degrees(rpy).T, strict=True))
    write(out, "attitude", {"time": own_s} | angles)
    depth = own.select("time", "m_depth").drop_nulls()
    write(out, "depth", {"time": depth["time"].to_numpy(), "depth": depth["m_depth"].to_numpy()})
    fixes = own.select("time", "m_gps_lat", "m_gps_lon").drop_nulls()
    lat, lon = (degrees(np.abs(fixes[name].to_numpy())) for name in ("m_gps_lat", "m_gps_lon"))
    write(out, "gps", {"time": fixes["time"].to_numpy(), "latitude": lat, "longitude": -lon})

    pd0 = pl.read_csv(source / "pd0_apr10.csv", infer_schema_length=None)
    time_s = pd0["time"].to_numpy() + GLIDER_CLOCK_S
    east, north, up, error = (pd0[f"btm_beam{k}_velocity"].cast(pl.Float64).to_numpy() for k in range(4))
    ranges = pd0.select(f"btm_beam{k}_range" for k in range(4)).cast(pl.Float64).to_numpy()
    # Bottom track is the motion of the bottom past the vehicle.
    velocity_ned = -np.stack([north, east, -up], 1)
    rows = np.clip(np.searchsorted(own_s, time_s, side="right") - 1, 0, len(own_s) - 1)
    attitude = Rotation.from_euler("ZYX", rpy[rows][:, ::-1])
    velocity = attitude.inv().apply(velocity_ned)
    write(
        out,
        "dvl",
        {"time": time_s}
        | {f"v{axis}": velocity[:, k] for k, axis in enumerate("xyz")}
        | {f"range_{k + 1}": ranges[:, k] for k in range(4)},
    )
    tilt = np.radians(PATHFINDER_TILT_DEG)
    azimuth = np.radians([45.0, 225.0, 315.0, 135.0])
    beams = np.stack(
        [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.full(4, np.cos(tilt))], 1
    )
    # The error velocity is along the combination of beams that no velocity causes.
    closure = np.array([0.5, 0.5, -0.5, -0.5]) * np.sqrt(2.0) * np.sin(tilt)
    profile(out, pd0, time_s, attitude, beams, closure)
    radial = velocity @ beams.T + np.where(np.isnan(error), 0.0, error)[:, None] * closure
    radial = np.where(np.isnan(ranges), np.nan, radial)
    write(
        out,
        "dvl_beams",
        {"time": time_s}
        | {f"beam{k + 1}_mps": radial[:, k] for k in range(4)}
        # Those of PD0 are vertical.
        | {f"beam{k + 1}_range_m": ranges[:, k] / np.cos(tilt) for k in range(4)},
    )


def profile(
    out: Path,
    pd0: pl.DataFrame,
    time_s: np.ndarray,
    attitude: Rotation,
    beams: np.ndarray,
    closure: np.ndarray,
) -> None:
    """The water table of the first cells of each ensemble; a solution by three beams counts for the first three."""
    pings, cells = len(time_s), np.arange(PROFILE_CELLS)
    components = np.stack(
        [[pd0[f"vel_bin{cell}_beam{k}"].cast(pl.Float64).to_numpy() for k in range(4)] for cell in cells]
    ).transpose(2, 0, 1)
    east, north, up, error = (components[:, :, k].ravel() for k in range(4))
    rotation = Rotation.from_quat(np.repeat(attitude.as_quat(), len(cells), axis=0))
    velocity = rotation.inv().apply(-np.stack([north, east, -up], 1))
    solved = np.isfinite(velocity).all(axis=1)
    whole = solved & np.isfinite(error)
    radial = velocity @ beams.T + np.where(whole, error, 0.0)[:, None] * closure
    valid = np.stack([solved, solved, solved, whole], axis=1)
    cosine = np.cos(np.radians(PATHFINDER_TILT_DEG))
    depth_m = pd0["bin0_distance"][0] + pd0["depth_bin_length"][0] * cells
    none = np.full(radial.shape, np.nan)
    table = WaterTable(
        np.repeat(np.round(time_s * 1e9).astype(np.int64), len(cells)),
        np.tile(cells + 1, pings),
        np.tile(depth_m / cosine, pings),
        np.where(valid, radial, np.nan),
        valid,
        none,
        none,
    )
    write_parquet(water_file(out / "dvl_beams.csv"), table.to_frame())
