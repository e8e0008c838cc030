"""The packaged survey dive as a bag of ROS 2: messages made by rosbags, in the order in which they would arrive."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.io import ros as ros_reader
from bottomlock.kernel import normal_gravity_mps2

LATITUDE_DEG = 32.8
DENSITY, SURFACE_PA = 1025.0, 101_325.0
DELAYS_NS = {"/imu": 4_000_000, "/dvl": 170_000_000, "/pressure": 20_000_000, "/usbl": 1_500_000_000}
TYPES = {
    "/imu": "sensor_msgs/msg/Imu",
    "/dvl": "marine_acoustic_msgs/msg/Dvl",
    "/pressure": "sensor_msgs/msg/FluidPressure",
    "/usbl": "geometry_msgs/msg/PoseWithCovarianceStamped",
}

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


class Messages:
    """The messages of the dive, as the library makes and serialises them."""

    def __init__(self) -> None:
        self.store: Any = ros_reader.typestore()
        self._types = self.store.types

    def bytes_of(self, topic: str, message: Any) -> bytes:  # noqa: ANN401
        """Serialised, of the type of a topic."""
        return bytes(self.store.serialize_cdr(message, TYPES[topic]))

    def header(self, time_ns: int, frame_id: str) -> Any:  # noqa: ANN401
        """With a stamp and a frame."""
        time = self._types["builtin_interfaces/msg/Time"]
        sec, nanosec = divmod(time_ns, 1_000_000_000)
        return self._types["std_msgs/msg/Header"](stamp=time(sec=sec, nanosec=nanosec), frame_id=frame_id)

    def vector(self, x: float, y: float, z: float) -> Any:  # noqa: ANN401
        """A `Vector3`."""
        return self._types["geometry_msgs/msg/Vector3"](x=float(x), y=float(y), z=float(z))

    def imu(self, time_ns: int, omega_flu: Any, force_flu: Any) -> Any:  # noqa: ANN401
        """Inertial readings, forward-left-up, without an orientation."""
        none = np.zeros(9)
        none[0] = -1.0
        return self._types[TYPES["/imu"]](
            header=self.header(time_ns, "imu_link"),
            orientation=self._types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=0.0),
            orientation_covariance=none,
            angular_velocity=self.vector(*omega_flu),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(*force_flu),
            linear_acceleration_covariance=np.zeros(9),
        )

    def dvl(self, time_ns: int, velocity: Any, range_m: Any, directions: Any) -> Any:  # noqa: ANN401
        """Beams, NaN for one that is lost."""
        good = np.isfinite(velocity)
        return self._types[TYPES["/dvl"]](
            header=self.header(time_ns, "dvl_link"),
            velocity_mode=1,
            dvl_type=1,
            velocity=self.vector(math.nan, math.nan, math.nan),
            velocity_covar=np.full(9, -1.0),
            altitude=math.nan,
            course_gnd=math.nan,
            speed_gnd=math.nan,
            num_good_beams=int(good.sum()),
            sound_speed=1500.0,
            beam_ranges_valid=True,
            beam_velocities_valid=True,
            beam_unit_vec=[self.vector(*row) for row in directions],
            range=np.asarray(range_m, dtype=np.float64),
            range_covar=np.full(4, -1.0, dtype=np.float32),
            beam_quality=np.full(4, math.nan, dtype=np.float32),
            beam_velocity=np.asarray(velocity, dtype=np.float32),
            beam_velocity_covar=np.where(good, 1e-4, -1.0).astype(np.float32),
        )

    def pressure(self, time_ns: int, depth_m: float) -> Any:  # noqa: ANN401
        """The pressure at a depth."""
        gravity = normal_gravity_mps2(math.radians(LATITUDE_DEG))
        return self._types[TYPES["/pressure"]](
            header=self.header(time_ns, "base_link"),
            fluid_pressure=SURFACE_PA + DENSITY * gravity * depth_m,
            variance=0.0,
        )

    def usbl(self, time_ns: int, north: float, east: float, down: float) -> Any:  # noqa: ANN401
        """A position, with variances of its axes."""
        types = self._types
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = np.diag([1.21, 1.0, 2.25])  # east, north, up
        return types[TYPES["/usbl"]](
            header=self.header(time_ns, "map"),
            pose=types["geometry_msgs/msg/PoseWithCovariance"](
                pose=types["geometry_msgs/msg/Pose"](
                    position=types["geometry_msgs/msg/Point"](x=east, y=north, z=-down),
                    orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                ),
                covariance=covariance.ravel(),
            ),
        )


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
        entries.append((time_ns, "/pressure", messages.pressure(time_ns, depth_m)))
    for time_ns, north, east, down in pl.read_csv(folder / "usbl.csv").iter_rows():
        entries.append((time_ns, "/usbl", messages.usbl(time_ns, north, east, down)))
    chosen = [
        Arrival(time_ns + DELAYS_NS[topic], topic, messages.bytes_of(topic, message))
        for time_ns, topic, message in entries
        if time_ns <= last_ns
    ]
    yield from sorted(chosen, key=lambda one: (one.time_ns, one.topic))


def write_bag(path: Path, played: list[Arrival]) -> None:
    """The arrivals as a bag, written by the library."""
    from rosbags.rosbag2 import Writer
    from rosbags.rosbag2.enums import StoragePlugin

    store = ros_reader.typestore()
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            topic: writer.add_connection(topic, name, typestore=store) for topic, name in TYPES.items()
        }
        for one in played:
            writer.write(connections[one.topic], one.time_ns, one.data)


def read_bag(path: Path) -> tuple[list[Arrival], list[tuple[str, Any]]]:
    """The arrivals of a bag, and their messages as the library reads them, by topic."""
    from rosbags.highlevel import AnyReader

    played, read = [], []
    with AnyReader([path], default_typestore=ros_reader.typestore()) as reader:
        for connection, time_ns, data in reader.messages():
            played.append(Arrival(time_ns, connection.topic, bytes(data)))
            read.append((connection.topic, reader.deserialize(data, connection.msgtype)))
    return played, read
