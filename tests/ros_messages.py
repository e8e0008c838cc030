"""Messages of ROS as drivers send them, made by the library rosbags, and bags of them."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock.io.ros import typestore

IMU, DVL = "sensor_msgs/msg/Imu", "marine_acoustic_msgs/msg/Dvl"
PRESSURE, POSE = "sensor_msgs/msg/FluidPressure", "geometry_msgs/msg/PoseWithCovarianceStamped"


class Messages:
    """The library's own messages; `store` knows their types."""

    def __init__(self, store: Any = None) -> None:  # noqa: ANN401 - the library's own objects, here and below
        self.store: Any = typestore() if store is None else store
        self.types = self.store.types

    def header(self, time_ns: int, frame_id: str) -> Any:  # noqa: ANN401
        """With a stamp and a frame; of ROS 1 with a number as well."""
        sec, nanosec = divmod(time_ns, 1_000_000_000)
        stamp, kind = (
            self.types["builtin_interfaces/msg/Time"](sec, nanosec),
            self.types["std_msgs/msg/Header"],
        )
        numbered = {"seq": 0} if "seq" in kind.__dataclass_fields__ else {}
        return kind(stamp=stamp, frame_id=frame_id, **numbered)

    def vector(self, x: float, y: float, z: float) -> Any:  # noqa: ANN401
        """A `Vector3`."""
        return self.types["geometry_msgs/msg/Vector3"](x=float(x), y=float(y), z=float(z))

    def quaternion(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, w: float = 1.0) -> Any:  # noqa: ANN401
        """A `Quaternion`."""
        return self.types["geometry_msgs/msg/Quaternion"](x=float(x), y=float(y), z=float(z), w=float(w))

    def imu(
        self,
        time_ns: int,
        omega_flu: Any,  # noqa: ANN401
        force_flu: Any,  # noqa: ANN401
        orientation: Any = (0.0, 0.0, 0.0, 0.0),  # noqa: ANN401
        variance: float | None = None,
    ) -> Any:  # noqa: ANN401
        """Inertial readings, forward-left-up; without a variance the orientation is none."""
        none = np.zeros(9)
        none[0] = -1.0
        return self.types[IMU](
            header=self.header(time_ns, "imu_link"),
            orientation=self.quaternion(*orientation),
            orientation_covariance=none if variance is None else variance * np.eye(3).ravel(),
            angular_velocity=self.vector(*omega_flu),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(*force_flu),
            linear_acceleration_covariance=np.zeros(9),
        )

    def dvl(self, time_ns: int, beams: Any, range_m: Any, directions: Any, **changed: Any) -> Any:  # noqa: ANN401
        """Beams without a velocity, NaN for one that is lost, and fields that are others."""
        good = np.isfinite(beams)
        fields = {
            "header": self.header(time_ns, "dvl_link"), "velocity_mode": 1, "dvl_type": 1,
            "velocity": self.vector(math.nan, math.nan, math.nan), "velocity_covar": np.full(9, -1.0),
            "altitude": math.nan, "course_gnd": math.nan, "speed_gnd": math.nan, "num_good_beams": int(good.sum()),
            "sound_speed": 1500.0, "beam_ranges_valid": True, "beam_velocities_valid": True,
            "beam_unit_vec": [self.vector(*row) for row in directions],
            "range": np.asarray(range_m, dtype=np.float64),
            "range_covar": np.full(len(good), -1.0, dtype=np.float32),
            "beam_quality": np.full(len(good), math.nan, dtype=np.float32),
            "beam_velocity": np.asarray(beams, dtype=np.float32),
            "beam_velocity_covar": np.where(good, 1e-4, -1.0).astype(np.float32),
        }  # fmt: skip
        return self.types[DVL](**(fields | changed))

    def pressure(self, time_ns: int, pascal: float, frame_id: str = "base_link") -> Any:  # noqa: ANN401
        """A pressure."""
        return self.types[PRESSURE](
            header=self.header(time_ns, frame_id), fluid_pressure=pascal, variance=0.0
        )

    def usbl(
        self,
        time_ns: int,
        north: float,
        east: float,
        down: float,
        variances: tuple[float, ...] = (1.21, 1.0, 2.25),
    ) -> Any:  # noqa: ANN401
        """A position, with variances of its axes east, north, up."""
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = np.diag(variances)
        point = self.types["geometry_msgs/msg/Point"](x=float(east), y=float(north), z=float(-down))
        there = self.types["geometry_msgs/msg/Pose"](position=point, orientation=self.quaternion())
        pose = self.types["geometry_msgs/msg/PoseWithCovariance"](pose=there, covariance=covariance.ravel())
        return self.types[POSE](header=self.header(time_ns, "map"), pose=pose)


def write_ros2(
    path: Path, sent: Iterable[tuple[int, str, str, Any]], store: Any, *, mcap: bool = True  # noqa: ANN401
) -> Path:  # fmt: skip
    """A bag of ROS 2 by times of arrival: time, topic, type, and the message or its bytes."""
    from rosbags.rosbag2 import Writer
    from rosbags.rosbag2.enums import StoragePlugin

    plugin, connections = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3, {}
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for ns, topic, kind, message in sorted(sent, key=lambda one: one[0]):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            raw = message if isinstance(message, bytes) else store.serialize_cdr(message, kind)
            writer.write(connections[topic], ns, raw)
    return path


def write_ros1(path: Path, sent: Iterable[tuple[int, str, str, Any]], store: Any) -> Path:  # noqa: ANN401
    """A bag of ROS 1, of the same."""
    from rosbags.rosbag1 import Writer

    connections: dict[str, Any] = {}
    with Writer(path) as writer:
        for ns, topic, kind, message in sent:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            raw = message if isinstance(message, bytes) else store.serialize_ros1(message, kind)
            writer.write(connections[topic], ns, raw)
    return path
