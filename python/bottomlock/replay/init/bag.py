"""Streams beside the DVL in ROS bags, as tables: IMU, attitude, positions, pressure."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.io.ros import typestore
from bottomlock.io.ros_messages import stamp_ns
from bottomlock.io.sentences import printable
from bottomlock.replay.init.any_table import AnyTable

_Row = dict[str, float]


def _vector(message: Any, names: tuple[str, ...]) -> _Row:  # noqa: ANN401 - a message of a bag
    return {f"{name}": float(getattr(message, name[-1])) for name in names}


def _imu(m: Any) -> _Row:  # noqa: ANN401
    rows = _vector(m.linear_acceleration, ("acc_x", "acc_y", "acc_z"))
    rows |= _vector(m.angular_velocity, ("gyro_x", "gyro_y", "gyro_z"))
    q = m.orientation
    known = float(m.orientation_covariance[0]) >= 0.0 and abs(q.w) + abs(q.x) + abs(q.y) + abs(q.z) > 0.0
    return rows | (_vector(q, ("q_w", "q_x", "q_y", "q_z")) if known else {})


def _odometry(m: Any) -> _Row:  # noqa: ANN401 - x east, y north, z up by convention
    p, q = m.pose.pose.position, m.pose.pose.orientation
    return {"east": float(p.x), "north": float(p.y), "down": -float(p.z)} | _vector(
        q, ("q_w", "q_x", "q_y", "q_z")
    )


READERS: dict[str, Callable[[Any], _Row]] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/NavSatFix": lambda m: {
        "latitude": float(m.latitude), "longitude": float(m.longitude), "height": float(m.altitude)
    },
    "sensor_msgs/msg/FluidPressure": lambda m: {"pressure_pa": float(m.fluid_pressure)},
    "sensor_msgs/msg/MagneticField": lambda m: _vector(m.magnetic_field, ("mag_x", "mag_y", "mag_z")),
    "nav_msgs/msg/Odometry": _odometry,
}  # fmt: skip


def bag_tables(path: Path) -> list[AnyTable]:
    """A table for each topic of a known type, with the stamp of the header.

    Raises:
        DataError: where the library is not installed, or cannot read the bag.
    """
    store = typestore()
    from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra; typestore raises without it

    rows: dict[str, list[_Row]] = {}
    try:
        with AnyReader([path], default_typestore=store) as reader:
            chosen = [c for c in reader.connections if c.msgtype in READERS]
            for connection, _, raw in reader.messages(connections=chosen) if chosen else ():
                message: Any = reader.deserialize(raw, connection.msgtype)
                one: dict[str, Any] = {"time_ns": stamp_ns(message.header)}
                rows.setdefault(connection.topic, []).append(one | READERS[connection.msgtype](message))
    # A damaged bag raises whatever the library's parts raise.
    except Exception as error:
        reason = printable(str(error).splitlines()[0])[:200] if str(error) else type(error).__name__
        raise DataError(f"{path}: cannot be read as a bag ({reason})") from error
    return [
        AnyTable(
            path, pl.DataFrame(of, infer_schema_length=None), plain=False, units={}, words=f"topic {topic}"
        )
        for topic, of in rows.items()
    ]
