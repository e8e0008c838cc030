"""A right case of a simulated dive with known truth, and the mistakes that are put into it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.replay.case import Case, load_case
from tests.dive import Dive, drawn_dive

CASE = """
name = "dive"
[origin]
latitude_deg = 45.0
[imu]
file = "imu.parquet"
clock = { column = "t", unit = "s" }
force = ["ax", "ay", "az"]
omega = ["wx", "wy", "wz"]
omega_unit = "rad/s"
axes = ["x", "y", "z"]
[imu.errors]
accel_bias_mg = 1.0
gyro_bias_deg_per_h = 20.0
accel_noise_mps_per_rt_h = 0.085
gyro_noise_deg_per_rt_h = 0.25
[dvl]
file = "beams.parquet"
clock = { column = "time_ns", unit = "ns", offset_s = 0.0 }
geometry = "dvl.toml"
beam_noise_mps = 0.008
[depth]
file = "depth.parquet"
clock = { column = "t", unit = "s" }
column = "depth"
up = false
sd_m = 0.03
[attitude]
file = "attitude.parquet"
clock = { column = "t", unit = "s" }
roll = "roll"
pitch = "pitch"
yaw = "yaw"
yaw_sd_deg = 1.0
aids = "nothing"
[reference]
file = "reference.parquet"
clock = { column = "t", unit = "s" }
north = "north"
east = "east"
down = "down"
[start]
at_s = 15.0
level = "given"
roll_deg = 0.0
pitch_deg = 0.0
level_sd_deg = 0.3
heading = "given"
heading_deg = 0.0
heading_sd_deg = 2.0
velocity = "beams"
velocity_mps = [0.0, 0.0, 0.0]
position = "reference"
position_sd_m = [0.1, 0.1, 0.1]
[replay]
methods = ["lc", "tc"]
smooth = false
"""
GEOMETRY = """
configuration = "angles"
tilts_deg = [22.5, 22.5, 22.5, 22.5]
azimuths_deg = [135.0, -135.0, -45.0, 45.0]
beam_noise_mps = 0.008
sound_speed_scale = 1.0
mounting_roll_deg = 0.0
mounting_pitch_deg = 0.0
mounting_yaw_deg = 0.0
"""


def write_case(dive: Dive, folder: Path) -> Path:
    """Tables, geometry and a case without a mistake."""
    rng = np.random.default_rng(7)
    t = dive.imu_s
    columns = {f"a{axis}": dive.force[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"w{axis}": dive.omega[:, k] for k, axis in enumerate("xyz")}
    pl.DataFrame({"t": t} | columns).write_parquet(folder / "imu.parquet")
    beams: dict[str, object] = {"time_ns": np.round(dive.ping_s * 1e9).astype(np.int64)}
    for k in range(dive.beams.shape[1]):
        beams |= {f"beam{k + 1}_mps": dive.beams[:, k], f"beam{k + 1}_valid": np.isfinite(dive.beams[:, k])}
    pl.DataFrame(beams).write_parquet(folder / "beams.parquet")
    few = slice(0, None, 10)
    depth = dive.position[few, 2] + 0.02 * rng.normal(size=len(t[few]))
    pl.DataFrame({"t": t[few], "depth": depth}).write_parquet(folder / "depth.parquet")
    angles = dive.rpy[few] + np.deg2rad(0.3) * rng.normal(size=(len(t[few]), 3))
    pl.DataFrame(
        {"t": t[few]} | {n: angles[:, k] for k, n in enumerate(("roll", "pitch", "yaw"))}
    ).write_parquet(folder / "attitude.parquet")
    second = slice(0, None, 50)
    places = {n: dive.position[second, k] for k, n in enumerate(("north", "east", "down"))}
    pl.DataFrame({"t": t[second]} | places).write_parquet(folder / "reference.parquet")
    (folder / "dvl.toml").write_text(GEOMETRY, encoding="utf-8")
    row = int(np.searchsorted(t, 15.0))
    roll, pitch, yaw = np.rad2deg(dive.rpy[row])
    text = CASE.replace("roll_deg = 0.0", f"roll_deg = {roll:.4f}").replace(
        "pitch_deg = 0.0", f"pitch_deg = {pitch:.4f}"
    )
    text = text.replace("heading_deg = 0.0", f"heading_deg = {yaw:.4f}")
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return folder / "case.toml"


Mistake = Callable[[Path], None]


def edited(name: str, *changes: tuple[str, str]) -> Mistake:
    """A mistake in a text file."""

    def edit(folder: Path) -> None:
        text = (folder / name).read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (folder / name).write_text(text, encoding="utf-8")

    return edit


def table(name: str, **columns: pl.Expr) -> Mistake:
    """A mistake in a table."""

    def edit(folder: Path) -> None:
        path = folder / f"{name}.parquet"
        pl.read_parquet(path).with_columns(**columns).write_parquet(path)

    return edit


def number(folder: Path, key: str) -> float:
    """A number of the case."""
    for line in (folder / "case.toml").read_text(encoding="utf-8").splitlines():
        if line.startswith(f"{key} = "):
            return float(line.split(" = ")[1])
    raise AssertionError(key)


def added(key: str, amount: float) -> Mistake:
    """A mistake in a number of the case."""

    def edit(folder: Path) -> None:
        old = number(folder, key)
        edited("case.toml", (f"\n{key} = {old:.4f}", f"\n{key} = {old + amount:.4f}"))(folder)

    return edit


def magnetic(folder: Path) -> None:
    """A compass without its declination of 15 degrees aids, and gives the start."""
    table("attitude", yaw=pl.col("yaw") - float(np.deg2rad(15.0)))(folder)
    edited("case.toml", ('aids = "nothing"', 'aids = "heading"'))(folder)
    added("heading_deg", -15.0)(folder)


def attitude_turned(folder: Path) -> None:
    """The attitude sensor is mounted a quarter turn to the right, and nothing says so."""
    path = folder / "attitude.parquet"
    frame = pl.read_parquet(path)
    sensor = Rotation.from_euler("ZYX", frame.select("yaw", "pitch", "roll").to_numpy())
    turned = (sensor * Rotation.from_euler("Z", np.pi / 2.0)).as_euler("ZYX")
    columns = {name: turned[:, k] for k, name in enumerate(("yaw", "pitch", "roll"))}
    frame.with_columns(**{name: pl.Series(values) for name, values in columns.items()}).write_parquet(path)


def other_positions(folder: Path) -> None:
    """The positions of another dive, from the same start."""
    path = folder / "reference.parquet"
    frame, other = pl.read_parquet(path), drawn_dive(77)
    place = other.at(frame["t"].to_numpy(), other.position)
    columns = {name: pl.Series(place[:, k]) for k, name in enumerate(("north", "east", "down"))}
    frame.with_columns(**columns).write_parquet(path)


def both(*mistakes: Mistake) -> Mistake:
    """Several changes one after another."""

    def edit(folder: Path) -> None:
        for one in mistakes:
            one(folder)

    return edit


RANGE = edited("case.toml", ("[imu.errors]", "[imu.limits]\nmax_rate_deg_per_s = 2e5\n[imu.errors]"))
"""The gyros pass the check of their range, which would reject such a log."""
DEGREES = {f"w{axis}": pl.col(f"w{axis}") * float(np.rad2deg(1.0)) for axis in "xyz"}
BEAM = {k: pl.col(f"beam{k}_mps") for k in range(1, 5)}
EXCHANGED = {f"beam{k}_{q}": pl.col(f"beam{3 - k}_{q}") for k in (1, 2) for q in ("mps", "valid")}
STARTS_FAST = edited(
    "case.toml",
    ('"beams"\nvelocity_mps = [0.0, 0.0, 0.0]', '"given"\nvelocity_mps = [2.0, 0.0, 0.0]'),
)
MISTAKES: dict[str, tuple[Mistake, str, str]] = {
    "mounting yaw 10 deg": (edited("dvl.toml", ("yaw_deg = 0.0", "yaw_deg = 10.0")), "mounting", "yaw"),
    "mounting pitch 6 deg": (edited("dvl.toml", ("pitch_deg = 0.0", "pitch_deg = 6.0")), "mounting", "pitch"),
    "DVL turned by 90 deg": (edited("dvl.toml", ("yaw_deg = 0.0", "yaw_deg = 90.0")), "axes", "imu.axes"),
    "IMU axes exchanged": (edited("case.toml", ('["x", "y", "z"]', '["y", "x", "z"]')), "axes", "imu.axes"),
    "IMU axis reversed": (edited("case.toml", ('["x", "y", "z"]', '["x", "-y", "z"]')), "axes", "imu.axes"),
    "gyro z reversed": (table("imu", wz=-pl.col("wz")), "gyro_sign", "imu.omega"),
    "gyro x reversed": (table("imu", wx=-pl.col("wx")), "gyro_sign", "imu.omega"),
    "beams reversed": (table("beams", **{f"beam{k}_mps": -BEAM[k] for k in BEAM}), "axes", "dvl.file"),
    "DVL clock 0.3 s": (table("beams", time_ns=pl.col("time_ns") + 300_000_000), "clock", "dvl.clock.offset_s"),
    "tenfold gyro bias": (table("imu", wx=pl.col("wx") + 1e-3, wy=pl.col("wy") - 8e-4), "gyro_offset", "gyro_bias"),
    "sound speed 5 %": (edited("dvl.toml", ("scale = 1.0", "scale = 1.05")), "scale", "sound_speed_scale"),
    "tilt 30 deg": (edited("dvl.toml", ("22.5", "30.0")), "scale", "dvl.geometry"),
    "beams 1 and 2 exchanged": (table("beams", **EXCHANGED), "beam_order", "dvl.geometry"),
    "deg/s taken for rad/s": (edited("case.toml", ('"rad/s"', '"deg/s"')), "gyro_unit", "imu.omega_unit"),
    "start level 8 deg": (added("roll_deg", 8.0), "start_level", "start.level"),
    "start velocity": (STARTS_FAST, "start_velocity", "start.velocity"),
    "start heading 60 deg": (added("heading_deg", 60.0), "start_heading", "start.heading"),
    "depth positive up": (edited("case.toml", ("up = false", "up = true")), "depth_sign", "depth.up"),
    "quarter of the noise": (edited("case.toml", ("= 0.008", "= 0.002")), "beam_noise", "dvl.beam_noise_mps"),
    "rad/s taken for deg/s": (both(table("imu", **DEGREES), RANGE), "gyro_unit", "imu.omega_unit"),
    "AHRS turned by 90 deg": (attitude_turned, "attitude_mounting", "attitude.mounting_yaw_deg"),
    "compass 90 deg off": (table("attitude", yaw=pl.col("yaw") + np.pi / 2.0), "attitude_heading", "yaw_offset_deg"),
    "positions of another dive": (other_positions, "other_dive", "reference.file"),
    "magnetic heading": (magnetic, "magnetic_heading", "yaw_offset_deg"),
}  # fmt: skip
"""Name: the mistake, kind of the first cause, part of its key."""


def mistaken(dive: Dive, folder: Path, name: str) -> Case:
    """The case with one mistake."""
    path = write_case(dive, folder)
    MISTAKES[name][0](folder)
    return load_case(path)
