"""Streams beside the DVL in ROS bags, as tables: IMU, attitude, positions, pressure, depth, velocities.

Frames are those of REP 103, x east, y north, z up and, of the vehicle, x forward, y left, z up, except where the
name of the frame has "ned" or "frd" in it. A stamp of 0 is none: then the bag's time is used.
"""

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


def _position(m: Any, p: Any) -> _Row:  # noqa: ANN401
    x, y, z = float(p.x), float(p.y), float(p.z)
    if "ned" in m.header.frame_id.lower():
        return {"north": x, "east": y, "down": z}
    return {"east": x, "north": y, "down": -z}


def _posed(m: Any, pose: Any) -> _Row:  # noqa: ANN401
    """Position, and the attitude where it is one: a transponder has none, and its message the identity or zeros."""
    q = pose.orientation
    turned = abs(q.x) + abs(q.y) + abs(q.z) > 0.0
    return _position(m, pose.position) | (_vector(q, ("q_w", "q_x", "q_y", "q_z")) if turned else {})


def _velocity(m: Any, twist: Any) -> _Row:  # noqa: ANN401
    x, y, z = (float(getattr(twist.linear, axis)) for axis in "xyz")
    sign = 1.0 if any(word in m.header.frame_id.lower() for word in ("frd", "ned")) else -1.0
    return {"surge_mps": x, "sway_mps": sign * y, "heave_mps": sign * z}


def _fix(m: Any) -> _Row:  # noqa: ANN401
    if m.status.status < 0:
        return {}
    return {"latitude": float(m.latitude), "longitude": float(m.longitude), "height": float(m.altitude)}


READERS: dict[str, Callable[[Any], _Row]] = {
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/NavSatFix": _fix,
    "sensor_msgs/msg/FluidPressure": lambda m: {"pressure_pa": float(m.fluid_pressure)},
    "sensor_msgs/msg/MagneticField": lambda m: _vector(m.magnetic_field, ("mag_x", "mag_y", "mag_z")),
    "nav_msgs/msg/Odometry": lambda m: _posed(m, m.pose.pose),
    "geometry_msgs/msg/PoseStamped": lambda m: _posed(m, m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _posed(m, m.pose.pose),
    "geometry_msgs/msg/PointStamped": lambda m: _position(m, m.point),
    "geometry_msgs/msg/QuaternionStamped": lambda m: _vector(m.quaternion, ("q_w", "q_x", "q_y", "q_z")),
    "geometry_msgs/msg/TwistStamped": lambda m: _velocity(m, m.twist),
    "geometry_msgs/msg/TwistWithCovarianceStamped": lambda m: _velocity(m, m.twist.twist),
}  # fmt: skip
DEPTHS = ("std_msgs/msg/Float64", "std_msgs/msg/Float32")
"""Numbers without a header: a depth where the topic's name says so, at the time of the bag."""
_REMARKS = {
    f"geometry_msgs/msg/{name}": "taken as forward, left, up (REP 103) unless its frame is named frd or ned"
    for name in ("TwistStamped", "TwistWithCovarianceStamped")
}
STAMPED = "stamped by the bag, since the message has no time"


def _is_depth(connection: Any) -> bool:  # noqa: ANN401 - the library's own object
    return connection.msgtype in DEPTHS and "depth" in connection.topic.lower()


def bag_tables(path: Path) -> list[AnyTable]:
    """A table for each topic of a known type, with the stamp of the header.

    Raises:
        DataError: where the library is not installed, or cannot read the bag.
    """
    store = typestore()
    from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra; typestore raises without it

    rows: dict[str, list[dict[str, Any]]] = {}
    remarks: dict[str, str] = {}
    try:
        with AnyReader([path], default_typestore=store) as reader:
            chosen = [c for c in reader.connections if c.msgtype in READERS or _is_depth(c)]
            for connection, arrival_ns, raw in reader.messages(connections=chosen) if chosen else ():
                message: Any = reader.deserialize(raw, connection.msgtype)
                time_ns = 0
                if connection.msgtype in READERS:
                    time_ns = stamp_ns(message.header)
                    row = READERS[connection.msgtype](message)
                else:
                    row = {"depth_m": float(message.data)}
                if not row:
                    continue
                rows.setdefault(connection.topic, []).append({"time_ns": time_ns or int(arrival_ns)} | row)
                remarks[connection.topic] = _REMARKS.get(connection.msgtype, "") if time_ns else STAMPED
    # A damaged bag raises whatever the library's parts raise.
    except Exception as error:
        reason = printable(str(error).splitlines()[0])[:200] if str(error) else type(error).__name__
        if not rows:
            raise DataError(f"cannot be read as a bag ({reason})", place=path) from error
        remarks = {
            topic: "; ".join(filter(None, (of, f"the bag breaks off ({reason})")))
            for topic, of in remarks.items()
        }
    return [
        AnyTable(
            path,
            pl.DataFrame(of, infer_schema_length=None),
            plain=False,
            units={},
            part=topic,
            remark=remarks[topic],
        )
        for topic, of in rows.items()
    ]
