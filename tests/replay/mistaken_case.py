"""Mistakes in a right case of a dive with known truth."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.replay.case import Case, load_case
from tests.dive import Dive, drawn_dive
from tests.dive_logs import write_case

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


compass_off = table("ahrs", heading_deg=pl.col("heading_deg") + 90.0)


def magnetic(folder: Path) -> None:
    """A compass without its declination of 15 degrees aids, and gives the start."""
    table("ahrs", heading_deg=pl.col("heading_deg") - 15.0)(folder)
    edited("case.toml", ('aids = "nothing"', 'aids = "heading"'))(folder)
    added("heading_deg", -15.0)(folder)


def attitude_turned(folder: Path) -> None:
    """The attitude sensor is mounted a quarter turn to the right, and nothing says so."""
    path, names = folder / "ahrs.parquet", ["heading_deg", "pitch_deg", "roll_deg"]
    frame = pl.read_parquet(path)
    sensor = Rotation.from_euler("ZYX", frame.select(names).to_numpy(), degrees=True)
    turned = (sensor * Rotation.from_euler("Z", np.pi / 2.0)).as_euler("ZYX", degrees=True)
    frame.with_columns(pl.DataFrame(turned, names).get_columns()).write_parquet(path)


def other_positions(folder: Path) -> None:
    """The positions of another dive, from the same start."""
    path = folder / "reference.parquet"
    frame, other = pl.read_parquet(path), drawn_dive(77)
    place = other.at(frame["time_s"].to_numpy(), other.position)
    frame.with_columns(pl.DataFrame(place, ["north", "east", "down"]).get_columns()).write_parquet(path)


def both(*mistakes: Mistake) -> Mistake:
    """Several changes one after another."""

    def edit(folder: Path) -> None:
        for one in mistakes:
            one(folder)

    return edit


RANGE = edited("case.toml", ("[imu.errors]", "[imu.limits]\nmax_rate_deg_per_s = 2e5\n[imu.errors]"))
"""The gyros pass the check of their range, which would reject such a log."""
DEGREES = {f"g{axis}": pl.col(f"g{axis}") * float(np.rad2deg(1.0)) for axis in "xyz"}
BEAM = {k: pl.col(f"beam{k}_mps") for k in range(1, 5)}
EXCHANGED = {f"beam{k}_{q}": pl.col(f"beam{3 - k}_{q}") for k in (1, 2) for q in ("mps", "valid")}
STARTS_FAST = edited(
    "case.toml", ('"beams"\nvelocity_mps = [0.0, 0.0, 0.0]', '"given"\nvelocity_mps = [2.0, 0.0, 0.0]')
)
MISTAKES: dict[str, tuple[Mistake, str, str]] = {
    "mounting yaw 3 deg": (edited("dvl.toml", ("yaw_deg = 0.0", "yaw_deg = 3.0")), "mounting", "yaw"),
    "mounting pitch 6 deg": (edited("dvl.toml", ("pitch_deg = 0.0", "pitch_deg = 6.0")), "mounting", "pitch"),
    "DVL turned by 90 deg": (edited("dvl.toml", ("yaw_deg = 0.0", "yaw_deg = 90.0")), "axes", "imu.axes"),
    "IMU axes exchanged": (edited("case.toml", ('["x", "y", "z"]', '["y", "x", "z"]')), "axes", "imu.axes"),
    "IMU axis reversed": (edited("case.toml", ('["x", "y", "z"]', '["x", "-y", "z"]')), "axes", "imu.axes"),
    "gyro z reversed": (table("imu", gz=-pl.col("gz")), "gyro_sign", "imu.omega"),
    "gyro x reversed": (table("imu", gx=-pl.col("gx")), "gyro_sign", "imu.omega"),
    "beams reversed": (table("beams", **{f"beam{k}_mps": -BEAM[k] for k in BEAM}), "axes", "dvl.file"),
    "DVL clock 0.3 s": (table("beams", time_ns=pl.col("time_ns") + 300_000_000), "clock", "dvl.clock.offset_s"),
    "tenfold gyro bias": (table("imu", gx=pl.col("gx") + 1e-3, gy=pl.col("gy") - 8e-4), "gyro_offset", "gyro_bias"),
    "sound speed 2.5 %": (edited("dvl.toml", ("scale = 1.0", "scale = 1.025")), "scale", "sound_speed_scale"),
    "tilt 30 deg": (edited("dvl.toml", ("22.5", "30.0")), "scale", "dvl.geometry"),
    "beams 1 and 2 exchanged": (table("beams", **EXCHANGED), "beam_order", "dvl.geometry"),
    "beam 2 reversed": (table("beams", beam2_mps=-BEAM[2]), "beam_order", "dvl.geometry"),
    "deg/s taken for rad/s": (edited("case.toml", ('"rad/s"', '"deg/s"')), "gyro_unit", "imu.omega_unit"),
    "start level 8 deg": (added("roll_deg", 8.0), "start_level", "start.level"),
    "start velocity": (STARTS_FAST, "start_velocity", "start.velocity"),
    "start heading 60 deg": (added("heading_deg", 60.0), "start_heading", "start.heading"),
    "depth positive up": (edited("case.toml", ("up = false", "up = true")), "depth_sign", "depth.up"),
    "depth of another dive": (table("depth", depth_m=pl.col("depth_m").reverse()), "depth_scale", "depth.unit"),
    "depth stands still": (table("depth", depth_m=pl.lit(3.0)), "depth_scale", "depth.unit"),
    "quarter of the noise": (edited("case.toml", ("= 0.008", "= 0.002")), "beam_noise", "dvl.beam_noise_mps"),
    "rad/s taken for deg/s": (both(table("imu", **DEGREES), RANGE), "gyro_unit", "imu.omega_unit"),
    "AHRS turned by 90 deg": (attitude_turned, "attitude_mounting", "attitude.mounting_yaw_deg"),
    "compass 90 deg off": (compass_off, "attitude_heading", "yaw_offset_deg"),
    "positions of another dive": (other_positions, "other_dive", "reference.file"),
    "magnetic heading": (magnetic, "magnetic_heading", "yaw_offset_deg"),
}  # fmt: skip
"""Name: the mistake, kind of the first cause, part of its key."""


def mistaken(dive: Dive, folder: Path, name: str) -> Case:
    """The case with one mistake."""
    path = write_case(dive, folder)
    MISTAKES[name][0](folder)
    return load_case(path)
