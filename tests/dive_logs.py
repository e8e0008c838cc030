"""The files of a dive: tables as CSV, makers' formats, files as people have them, bags of ROS 2."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from bottomlock.io.beams import read_geometry
from tests.dive import DENSITY, STANDARD_GRAVITY, SURFACE_PA, Dive, Floats, Tables, dvl_bytes, tables


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
    from rosbags.rosbag2 import Writer
    from rosbags.rosbag2.enums import StoragePlugin

    from bottomlock.io.ros import typestore

    store = typestore()
    types = store.types
    vector, pressed = types["geometry_msgs/msg/Vector3"], "sensor_msgs/msg/FluidPressure"
    sent: list[tuple[int, str, str, Any]] = []

    def header(ns: int, frame: str) -> Any:  # noqa: ANN401 - the library's own objects
        stamp = types["builtin_interfaces/msg/Time"](sec=ns // 1_000_000_000, nanosec=ns % 1_000_000_000)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)

    for ns, *row, quaternion in zip(
        _ns(held["imu"]), *held["imu"].drop("time_s").get_columns(), _orientation(held), strict=True
    ):
        force, omega = np.reshape(row, (2, 3)) * (1.0, -1.0, -1.0)
        empty = not quaternion[:3].any()
        imu = types["sensor_msgs/msg/Imu"](
            header(ns, "imu_link"), types["geometry_msgs/msg/Quaternion"](*quaternion),
            (0.0 if empty else 1e-4) * np.eye(3).ravel(), vector(*omega), np.zeros(9), vector(*force), np.zeros(9),
        )  # fmt: skip
        sent.append((ns + 5_000_000, "/imu/data", "sensor_msgs/msg/Imu", imu))
    for ns, depth in zip(_ns(held["depth"]), held["depth"]["depth_m"], strict=True):
        pressure = types[pressed](header(ns, "depth"), SURFACE_PA + DENSITY * STANDARD_GRAVITY * depth, 0.0)
        sent.append((ns + 4_000_000, "/ms5837/pressure", pressed, pressure))
    if "hull" in held:
        for ns, air in zip(_ns(held["hull"]), held["hull"]["pressure_pa"], strict=True):
            sent.append(
                (ns + 4_000_000, "/imu/pressure", pressed, types[pressed](header(ns, "imu"), air, 0.0))
            )
    kind = "marine_acoustic_msgs/msg/Dvl"
    for ns, stamp_ns, message in _pings(held["beams"], geometry, of_driver):
        vectors = {name: [vector(*one) for one in message[name]] for name in ("beam_unit_vec",)}
        fields = message | vectors | {"velocity": vector(*message["velocity"])}
        sent.append(
            (ns + 80_000_000, "/dvl", kind, types[kind](header=header(stamp_ns, "dvl_link"), **fields))
        )
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {topic: name for _, topic, name, _ in sent}
        connections = {
            topic: writer.add_connection(topic, name, typestore=store) for topic, name in topics.items()
        }
        for ns, topic, name, message in sorted(sent, key=lambda one: one[0]):
            writer.write(connections[topic], ns, store.serialize_cdr(message, name))
    return path


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


def _pings(table: pl.DataFrame, geometry: str, of_driver: bool) -> list[tuple[int, int, dict[str, Any]]]:
    """Time, stamp and fields of each message."""
    B = np.asarray(read_geometry(geometry).geometry.directions_p)
    inverse, found = np.linalg.pinv(B), []
    level = B[:, :2] / np.linalg.norm(B[:, :2], axis=1, keepdims=True)
    swapped = np.column_stack([level * B[:, 2:], np.linalg.norm(B[:, :2], axis=1)])
    n = len(B)
    for row in table.fill_null(np.nan).iter_rows(named=True):
        beams, ranges = (
            np.array([row[f"beam{k + 1}_{unit}"] for k in range(n)]) for unit in ("mps", "range_m")
        )
        good = np.isfinite(beams)
        enough = bool(good.sum() >= 3)
        solved = np.linalg.lstsq(B[good], beams[good], rcond=None)[0] if enough else np.zeros(3)
        velocity = solved if of_driver else inverse @ beams
        if of_driver:
            beams, ranges = np.where(good, beams, 0.0), np.where(good, ranges, -1.0)
        variance = np.zeros(n) if of_driver else np.where(good, 1e-4, -1.0)
        ns = round(row["time_s"] * 1e9)
        fields = {
            "velocity_mode": 1, "dvl_type": 1, "velocity": velocity, "velocity_covar": 1e-5 * np.eye(3).ravel(),
            "altitude": 4.0, "course_gnd": 0.0, "speed_gnd": 0.0, "num_good_beams": int(good.sum()),
            "sound_speed": 0.0 if of_driver else 1500.0, "beam_ranges_valid": True,
            "beam_velocities_valid": enough if of_driver else True, "beam_unit_vec": swapped if of_driver else B,
            "range": ranges, "range_covar": np.full(n, 0.0 if of_driver else -1.0, dtype=np.float32),
            "beam_quality": np.zeros(n, dtype=np.float32), "beam_velocity": beams.astype(np.float32),
            "beam_velocity_covar": variance.astype(np.float32),
        }  # fmt: skip
        found.append((ns, int(row.get("stamp_ns", ns)), fields))
    return found
