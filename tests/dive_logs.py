"""The files of a dive: a case, tables as CSV, makers' formats, files as people have them, bags of ROS 2."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.io.beams import read_geometry
from tests.dive import DENSITY, STANDARD_GRAVITY, SURFACE_PA, Dive, Floats, Tables, dvl_bytes, tables
from tests.ros_messages import DVL, IMU, PRESSURE, Messages, write_ros2
from tests.toml_text import toml


def write(held: Tables, folder: Path, words: str, *, geometry: str = "waterlinked_a50") -> list[Path]:
    """The files of words: tables by their names as CSV, a maker's format by its encoder's, a name of `LAYOUTS`, a bag.

    A bag is `bag`, or `driver_bag` with beams as the maker's ROS 2 driver fills the message.
    """
    files = []
    for word in words.split():
        if word in held:
            path = folder / f"{word}.csv"
            held[word].write_csv(path, float_precision=9)
        elif word in LAYOUTS:
            path = folder / LAYOUTS[word][0]
            path.write_bytes(LAYOUTS[word][1](held))
        elif word.endswith("bag"):
            path = write_bag(held, folder / word, geometry, of_driver=word == "driver_bag")
        else:
            path = folder / f"dvl.{word.rsplit('-', 1)[-1]}"
            path.write_bytes(dvl_bytes(held["beams"], word, geometry))
        files.append(path)
    return files


CASE = toml({
    "": {"name": "dive"},
    "origin": {"latitude_deg": 45.0},
    "imu": {
        "file": "imu.parquet", "clock": {"column": "time_s", "unit": "s"}, "force": ["ax", "ay", "az"],
        "omega": ["gx", "gy", "gz"], "omega_unit": "rad/s", "axes": ["x", "y", "z"],
    },
    "imu.errors": {
        "accel_bias_mg": 1.0, "gyro_bias_deg_per_h": 20.0, "accel_noise_mps_per_rt_h": 0.085,
        "gyro_noise_deg_per_rt_h": 0.25,
    },
    "dvl": {
        "file": "beams.parquet", "clock": {"column": "time_ns", "unit": "ns", "offset_s": 0.0},
        "geometry": "dvl.toml", "beam_noise_mps": 0.008,
    },
    "depth": {
        "file": "depth.parquet", "clock": {"column": "time_s", "unit": "s"}, "column": "depth_m", "up": False,
        "sd_m": 0.03,
    },
    "attitude": {
        "file": "ahrs.parquet", "clock": {"column": "time_s", "unit": "s"}, "roll": "roll_deg",
        "pitch": "pitch_deg", "yaw": "heading_deg", "unit": "deg", "yaw_sd_deg": 1.0, "aids": "nothing",
    },
    "reference": {
        "file": "reference.parquet", "clock": {"column": "time_s", "unit": "s"}, "north": "north", "east": "east",
        "down": "down",
    },
    "start": {
        "at_s": 15.0, "level": "given", "roll_deg": 0.0, "pitch_deg": 0.0, "level_sd_deg": 0.3, "heading": "given",
        "heading_deg": 0.0, "heading_sd_deg": 2.0, "velocity": "beams", "velocity_mps": [0.0] * 3,
        "position": "reference", "position_sd_m": [0.1] * 3,
    },
    "replay": {"methods": ["lc", "tc"], "smooth": False},
})  # fmt: skip
CASE_GEOMETRY = toml({
    "": {
        "configuration": "angles", "tilts_deg": [22.5] * 4, "azimuths_deg": [135.0, -135.0, -45.0, 45.0],
        "beam_noise_mps": 0.008, "sound_speed_scale": 1.0, "mounting_roll_deg": 0.0, "mounting_pitch_deg": 0.0,
        "mounting_yaw_deg": 0.0,
    },
})  # fmt: skip


def beam_table(made: Dive) -> pl.DataFrame:
    """The beams as `bottomlock convert` writes them."""
    time_ns = np.round(made.ping_s * 1e9).astype(np.int64)
    columns = {f"beam{k + 1}_mps": one for k, one in enumerate(made.beams.T)}
    columns |= {f"beam{k + 1}_valid": np.isfinite(one) for k, one in enumerate(made.beams.T)}
    return pl.DataFrame({"time_ns": time_ns} | columns).fill_nan(None)


def write_case(made: Dive, folder: Path) -> Path:
    """Tables, geometry and a case of them without a mistake; the reference is the truth, at 1 Hz."""
    held = dict(tables(made, start_s=0.0))
    held["reference"] = held.pop("truth").gather_every(5).select("time_s", "north", "east", "down")
    held["beams"] = beam_table(made)
    for name in ("imu", "beams", "depth", "ahrs", "reference"):
        held[name].write_parquet(folder / f"{name}.parquet")
    (folder / "dvl.toml").write_text(CASE_GEOMETRY, encoding="utf-8")
    text = CASE
    angles = np.rad2deg(made.rpy[np.searchsorted(made.imu_s, 15.0)])
    for name, angle in zip(("roll", "pitch", "heading"), angles, strict=True):
        text = text.replace(f"\n{name}_deg = 0.0", f"\n{name}_deg = {angle:.4f}")
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return folder / "case.toml"


def write_a50(made: Dive, path: Path, *, start_s: float = 0.0) -> Path:
    """The log of an A50 in the maker's JSON."""
    path.write_bytes(dvl_bytes(tables(made, start_s=start_s)["beams"], "waterlinked-json", made.geometry))
    return path


def write_csv(path: Path, columns: Mapping[str, Floats], *, separator: str = ",", digits: int = 9) -> Path:
    """Columns as a logger writes them."""
    pl.DataFrame(columns).write_csv(path, separator=separator, float_precision=digits)
    return path


def _merged(*names: str) -> Callable[[Tables], bytes]:
    """Several sensors in one CSV, blank where a sensor has no new value."""

    def merge(held: Tables) -> bytes:
        # No two sensors have new values at the same time.
        apart = [held[one].with_columns(pl.col("time_s") + 0.003 * k) for k, one in enumerate(names)]
        table = pl.concat(apart, how="diagonal").sort("time_s")
        kept = [one for one in table.columns if not one.endswith("range_m") and one != "altitude"]
        return table.select(kept).write_csv(float_precision=6).encode()

    return merge


def _echo(held: Tables) -> bytes:
    """`rostopic echo -p` of an A50: beams, flags and its own velocity in one table."""
    velocity, beams = held["velocity"].fill_null(0.0), held["beams"]
    ns = (pl.col("time_s") * 1e9).round().cast(pl.Int64)
    columns = [ns.alias("%time"), (ns - 400_000).alias("field.header.stamp")]
    columns += [pl.col(f"v{axis}").alias(f"field.velocity.{axis}") for axis in "xyz"]
    table = velocity.select(columns)
    for k in range(4):
        speed = beams[f"beam{k + 1}_mps"]
        table = table.with_columns(
            speed.fill_null(0.0).alias(f"field.beams{k}.velocity"),
            beams[f"beam{k + 1}_range_m"].fill_null(-1.0).alias(f"field.beams{k}.distance"),
            speed.is_not_null().cast(pl.Int8).alias(f"field.beams{k}.valid"),
        )
    whole = held["velocity"]["vx"].is_not_null().cast(pl.Int8)
    return table.with_columns(whole.alias("field.velocity_valid")).write_csv().encode()


def _json(held: Tables) -> list[Any]:
    lines = dvl_bytes(held["beams"].head(60), "waterlinked-json", "waterlinked_a50").splitlines()
    return [json.loads(one) for one in lines]


def _civil(held: Tables) -> bytes:
    """A date in six columns."""
    when = pl.from_epoch((pl.col("time_s") * 1e6).cast(pl.Int64), time_unit="us").dt
    parts = {
        "Year": when.year(), "Month": when.month(), "Day": when.day(), "Hour": when.hour(), "Minute": when.minute(),
        "Second": when.second() + when.microsecond() * 1e-6,
    }  # fmt: skip
    return held["velocity"].select(**parts, vx="vx", vy="vy", vz="vz").write_csv(float_precision=4).encode()


def _topics(held: Tables) -> bytes:
    """An export whose columns are topics with the instrument's company in them."""
    topic = "/waterlinked_dvl_driver/velocity_report/"
    beams = held["beams"].select("time_s", *(f"beam{k}_mps" for k in range(1, 5)))
    columns = ["__time", *(f"{topic}beam_velocity[{k}]" for k in range(4))]
    return beams.rename(dict(zip(beams.columns, columns, strict=True))).write_csv().encode()


def _bare(held: Tables) -> bytes:
    """`ros2 topic echo --csv`: no names."""
    rows = held["velocity"].drop_nulls().select("time_s", "vx", "vy", "vz").iter_rows()
    tail = ",".join(f"{k},0.004,6.494,-35.0,-95.0,True" for k in range(4))
    lines = [
        f"{int(s)},{round(s % 1 * 1e9)},dvl_link,200.0,{x},{y},{z},0.004,6.0,{tail},True,0,json_v2"
        for s, x, y, z in rows
    ]
    return "\n".join(lines).encode()


def _nqres(held: Tables) -> bytes:
    """Sentences of a NavQuest whose first token is damaged."""
    lines = []
    for row in held["beams"].drop_nulls().iter_rows(named=True):
        b = " ".join(f"{1e3 * row[f'beam{k}_mps']:.1f}" for k in range(1, 5))
        lines.append(
            f"$#NQ.RES 0X0000 1 1 1 1 6.49 6.49 6.49 6.49 {b} -11.9 -11.7 0.3 1 0 0 0 0 6.00 5 1 0 0 0 0"
        )
    return "\n".join(lines).encode()  # fmt: skip


LAYOUTS: dict[str, tuple[str, Callable[[Tables], bytes]]] = {
    "one_table": ("log.csv", _merged("ahrs", "depth", "imu", "velocity")),
    "one_table_beams": ("log.csv", _merged("ahrs", "imu", "beams")),
    "echo": ("dvl_data.csv", _echo),
    "civil": ("dvl_second.csv", _civil),
    "heading": (
        "heading.csv",
        lambda held: held["ahrs"].select("time_s", "heading_deg").write_csv().encode(),
    ),
    "array": ("array.json", lambda held: json.dumps(_json(held), indent=1).encode()),
    "utf16": ("utf16.json", lambda held: "\n".join(map(json.dumps, _json(held))).encode("utf-16")),
    "topics": ("plotjuggler.csv", _topics),
    "bare": ("ros2_echo.csv", _bare),
    "nqres": ("nqres.log", _nqres),
}
"""Other files by name: the file's, and its bytes."""


def write_bag(held: Tables, path: Path, geometry: str, *, of_driver: bool = False) -> Path:
    """A bag of ROS 2 in MCAP: IMU with the orientation of `ahrs`, pressures, a DVL; forward-left-up where ROS has it.

    Args:
        held: tables of the dive; `hull`, where it is there, is a second pressure; `beams` may hold `stamp_ns`.
        path: the bag's folder.
        geometry: of the DVL.
        of_driver: lost beams are 0 m/s at -1 m, and unit vectors lie by the elevation for the tilt.
    """
    messages, sent = Messages(), []
    rows = zip(_ns(held["imu"]), *held["imu"].drop("time_s").get_columns(), _orientation(held), strict=True)
    for ns, *row, quaternion in rows:
        force, omega = np.reshape(row, (2, 3)) * (1.0, -1.0, -1.0)
        imu = messages.imu(ns, omega, force, quaternion, 1e-4 if quaternion[:3].any() else 0.0)
        sent.append((ns + 5_000_000, "/imu/data", IMU, imu))
    for ns, depth in zip(_ns(held["depth"]), held["depth"]["depth_m"], strict=True):
        pressure = messages.pressure(ns, SURFACE_PA + DENSITY * STANDARD_GRAVITY * depth)
        sent.append((ns + 4_000_000, "/ms5837/pressure", PRESSURE, pressure))
    if "hull" in held:
        for ns, air in zip(_ns(held["hull"]), held["hull"]["pressure_pa"], strict=True):
            sent.append((ns + 4_000_000, "/imu/pressure", PRESSURE, messages.pressure(ns, air)))
    sent += [
        (ns + 80_000_000, "/dvl", DVL, one)
        for ns, one in _pings(held["beams"], geometry, messages, of_driver)
    ]
    return write_ros2(path, sent, messages.store)


def _ns(table: pl.DataFrame) -> list[int]:
    return [round(second * 1e9) for second in table["time_s"]]


def _orientation(held: Tables) -> Floats:
    """Quaternions, scalar last, of forward-left-up to east-north-up: the attitude before each inertial reading."""
    angles = held["ahrs"].select("heading_deg", "pitch_deg", "roll_deg").to_numpy()
    if not angles.any():
        return np.tile([0.0, 0.0, 0.0, 1.0], (held["imu"].height, 1))
    enu = Rotation.from_euler("ZYX", angles * (-1.0, -1.0, 1.0) + (90.0, 0.0, 0.0), degrees=True).as_quat()
    rows = held["ahrs"]["time_s"].search_sorted(held["imu"]["time_s"], side="right").to_numpy() - 1
    return np.asarray(enu[np.clip(rows, 0, None)])


def _pings(table: pl.DataFrame, geometry: str, messages: Messages, of_driver: bool) -> list[tuple[int, Any]]:
    B = np.asarray(read_geometry(geometry).geometry.directions_p)
    level, n = np.linalg.norm(B[:, :2], axis=1, keepdims=True), len(B)
    swapped = np.hstack([B[:, :2] / level * B[:, 2:], level])
    found = []
    for row in table.fill_null(np.nan).iter_rows(named=True):
        beams, ranges = (
            np.array([row[f"beam{k + 1}_{unit}"] for k in range(n)]) for unit in ("mps", "range_m")
        )
        good, ns = np.isfinite(beams), round(row["time_s"] * 1e9)
        enough = bool(good.sum() >= 3)
        fields: dict[str, Any] = {"velocity_covar": 1e-5 * np.eye(3).ravel(), "altitude": 4.0}
        if of_driver:
            beams, ranges = np.where(good, beams, 0.0), np.where(good, ranges, -1.0)
            velocity = np.linalg.lstsq(B[good], beams[good], rcond=None)[0] if enough else np.zeros(3)
            none = np.zeros(n, dtype=np.float32)
            fields |= {
                "num_good_beams": int(good.sum()), "sound_speed": 0.0, "beam_velocities_valid": enough,
                "range_covar": none, "beam_velocity_covar": none,
            }  # fmt: skip
        else:
            velocity = np.linalg.pinv(B) @ beams
        fields["velocity"] = messages.vector(*velocity)
        stamp_ns = int(row.get("stamp_ns", ns))
        found.append((ns, messages.dvl(stamp_ns, beams, ranges, swapped if of_driver else B, **fields)))
    return found
