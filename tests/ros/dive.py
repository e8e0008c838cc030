"""The packaged survey dive as a bag of ROS 2: messages made by rosbags, in the order in which they would arrive."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.io import ros as ros_reader
from bottomlock.kernel import normal_gravity_mps2
from tests.ros_messages import DVL, IMU, POSE, PRESSURE, Messages, write_ros2

LATITUDE_DEG = 32.8
DENSITY, SURFACE_PA = 1025.0, 101_325.0
DELAYS_NS = {"/imu": 4_000_000, "/dvl": 170_000_000, "/pressure": 20_000_000, "/usbl": 1_500_000_000}
TYPES = {"/imu": IMU, "/dvl": DVL, "/pressure": PRESSURE, "/usbl": POSE}

CONFIG = """
name = "dive"
mode = "navigation"
dvl.geometry = "teledyne_30"
[origin]
latitude_deg = 32.8
[imu]
rate_hz = 20
sampling = "averaged"
accel_bias_mg = 0.05
gyro_bias_deg_per_h = 0.1
accel_noise_mps_per_rt_h = 0.005
gyro_noise_deg_per_rt_h = 0.005
[depth]
sd_m = 0.02
[acoustic_position]
sd_m = 1.0
[start]
window_s = 5.0
heading_deg = -9.8
heading_sd_deg = 0.5
position_m = [0.0, 0.0, 20.0]
position_sd_m = [15.0, 15.0, 2.0]
velocity = "given"
velocity_mps = [1.97, 0.34, -0.01]
[[source]]
name = "dvl"
address = "ros:/dvl"
format = "ros-dvl"
rate_hz = 1
clock = "host"
[[source]]
name = "imu"
address = "ros:/imu"
format = "ros-imu"
rate_hz = 20
clock = "host"
[[source]]
name = "pressure"
address = "ros:/pressure"
format = "ros-pressure"
rate_hz = 1
clock = "host"
[[source]]
name = "usbl"
address = "ros:/usbl"
format = "ros-pose"
rate_hz = 0.1
clock = "host"
[[port]]
port = "ros_odometry"
to = "ros:/odometry"
[[port]]
port = "ros_tf"
to = "ros:/tf"
rate_hz = 5
[diagnostics]
to = "ros:/diagnostics"
"""


@dataclass(frozen=True)
class Arrival:
    """A message of the bag."""

    time_ns: int
    topic: str
    data: bytes


def pressure_pa(depth_m: float) -> float:
    """The pressure at a depth."""
    return SURFACE_PA + DENSITY * normal_gravity_mps2(math.radians(LATITUDE_DEG)) * depth_m


def arrivals(root: Path, seconds: float, directions: Any) -> Iterator[Arrival]:  # noqa: ANN401
    """The first seconds of the dive, by time of arrival."""
    folder, messages = root / "data" / "logs" / "survey_dive", Messages()
    entries: list[tuple[int, str, Any]] = []
    imu = pl.read_parquet(folder / "imu.parquet")
    last_ns = int(imu["time_ns"][0]) + round(seconds * 1e9)
    for time_ns, wx, wy, wz, fx, fy, fz in imu.iter_rows():
        entries.append((time_ns, "/imu", messages.imu(time_ns, (wx, -wy, -wz), (fx, -fy, -fz))))
    for row in pl.read_parquet(folder / "beams.parquet").iter_rows(named=True):
        velocity = [row[f"beam{k}_mps"] if row[f"beam{k}_valid"] else math.nan for k in range(1, 5)]
        ranges = [row[f"beam{k}_range_m"] or math.nan for k in range(1, 5)]
        entries.append((row["time_ns"], "/dvl", messages.dvl(row["time_ns"], velocity, ranges, directions)))
    for time_ns, depth_m in pl.read_csv(folder / "depth.csv").iter_rows():
        entries.append((time_ns, "/pressure", messages.pressure(time_ns, pressure_pa(depth_m))))
    for time_ns, north, east, down in pl.read_csv(folder / "usbl.csv").iter_rows():
        entries.append((time_ns, "/usbl", messages.usbl(time_ns, north, east, down)))
    chosen = [
        Arrival(time_ns + DELAYS_NS[topic], topic, bytes(messages.store.serialize_cdr(message, TYPES[topic])))
        for time_ns, topic, message in entries
        if time_ns <= last_ns
    ]
    yield from sorted(chosen, key=lambda one: (one.time_ns, one.topic))


def write_bag(path: Path, played: list[Arrival]) -> None:
    """The arrivals as a bag."""
    sent = [(one.time_ns, one.topic, TYPES[one.topic], one.data) for one in played]
    write_ros2(path, sent, ros_reader.typestore())


def read_bag(path: Path) -> tuple[list[Arrival], list[tuple[str, Any]]]:
    """The arrivals of a bag, and their messages as the library reads them, by topic."""
    from rosbags.highlevel import AnyReader

    played, read = [], []
    with AnyReader([path], default_typestore=ros_reader.typestore()) as reader:
        for connection, time_ns, data in reader.messages():
            played.append(Arrival(time_ns, connection.topic, bytes(data)))
            read.append((connection.topic, reader.deserialize(data, connection.msgtype)))
    return played, read
