"""Readings from ROS 2 messages: inertial, attitude, depth and positions.

By REP 103 a body's axes are forward, left, up, and the world's are east, north, up; ours are forward, right, down, and
north, east, down. A number that its message marks as missing (a covariance that begins with -1, no fix) is no reading.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bottomlock.errors import DataError
from bottomlock.io.framing import Framer
from bottomlock.io.ros_messages import decode, stamp_ns
from bottomlock.live.readings import Reader
from bottomlock.live.sections import ROS_TYPES, DepthSection
from bottomlock.recordings.readings import (
    AcousticPositionReading,
    AttitudeReading,
    DepthReading,
    GpsReading,
    ImuReading,
    Reading,
    Triple,
)
from bottomlock.recordings.sensors import is_on_earth

_MISSING = -1.0
_UNIT_TOLERANCE = 1e-3
_NOT_FINITE = "numbers that are not finite"
Message = Any


class _NoReadingError(Exception):
    """Why a message holds no reading."""


def _finite(*values: float) -> None:
    if not all(map(math.isfinite, values)):
        raise _NoReadingError(_NOT_FINITE)


def _frd(vector: Message) -> Triple:
    """A vector in forward-left-up axes, in forward-right-down ones."""
    _finite(vector.x, vector.y, vector.z)
    return vector.x, -vector.y, -vector.z


def _ned(point: Message) -> Triple:
    """A position east, north, up, as north, east, down."""
    _finite(point.x, point.y, point.z)
    return point.y, point.x, -point.z


def _imu(message: Message) -> Reading:
    if _MISSING in (message.angular_velocity_covariance[0], message.linear_acceleration_covariance[0]):
        raise _NoReadingError("no rates or no accelerations, by their covariance")
    return ImuReading(
        stamp_ns(message.header), _frd(message.angular_velocity), _frd(message.linear_acceleration)
    )


def _attitude(message: Message) -> Reading:
    """In the frames of the driver, which `attitude.frame` states."""
    if message.orientation_covariance[0] == _MISSING:
        raise _NoReadingError("no orientation, by its covariance")
    q = message.orientation
    norm = math.hypot(q.w, q.x, q.y, q.z)
    # Also not for numbers that are none.
    if not abs(norm - 1.0) < _UNIT_TOLERANCE:
        raise _NoReadingError("no unit quaternion")
    return AttitudeReading(stamp_ns(message.header), (q.w / norm, q.x / norm, q.y / norm, q.z / norm))


def _depth(message: Message) -> Reading:
    _finite(message.data)
    # The message has no stamp: a source of it has `clock` = "arrival".
    return DepthReading(0, message.data)


def _fix(message: Message) -> Reading:
    if message.status.status < 0:
        raise _NoReadingError("no fix, by its status")
    _finite(message.altitude)
    if not is_on_earth(message.latitude, message.longitude):
        raise _NoReadingError("numbers that are no latitude and longitude")
    return GpsReading(stamp_ns(message.header), message.latitude, message.longitude, message.altitude)


def _position(message: Message) -> Reading:
    east, north, up = (message.pose.covariance[k] for k in (0, 7, 14))
    stated = min(east, north, up) > 0.0 and math.isfinite(east + north + up)
    sd_m = (math.sqrt(north), math.sqrt(east), math.sqrt(up)) if stated else None
    return AcousticPositionReading(stamp_ns(message.header), _ned(message.pose.pose.position), sd_m)


_MAKERS: dict[str, Callable[[Message], Reading]] = {
    "ros-imu": _imu,
    "ros-attitude": _attitude,
    "ros-depth": _depth,
    "ros-navsat": _fix,
    "ros-pose": _position,
}


@dataclass
class RosReader(Reader[Reading]):
    """Readings from the messages of a topic.

    Args:
        format: "ros-pressure" or a key of `_MAKERS`.
        depth: turns a pressure into a depth; needed for "ros-pressure" alone.
        gravity_mps2: for that.
    """

    format: str
    depth: DepthSection | None = None
    gravity_mps2: float = math.nan

    def __post_init__(self) -> None:
        """Chooses the message."""
        self._type = ROS_TYPES[self.format].replace("/msg/", "/")
        self._make = (_MAKERS | {"ros-pressure": self._under_water})[self.format]
        self.framer = Framer()

    def feed(self, data: bytes) -> list[Reading]:
        """The reading of a message."""
        self.records += 1
        try:
            return [self._make(decode(data, self._type))]
        except (DataError, _NoReadingError) as error:
            self.skipped.add(str(error))
            return []

    def _under_water(self, message: Message) -> Reading:
        assert self.depth is not None
        _finite(message.fluid_pressure)
        depth_m = self.depth.depth_m(message.fluid_pressure, self.gravity_mps2)
        return DepthReading(stamp_ns(message.header), depth_m)
