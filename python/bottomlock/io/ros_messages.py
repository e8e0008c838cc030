"""ROS 2 messages from their serialised bytes, without ROS: the definitions that are read here, and a reader of CDR.

A number is aligned to its size, counted from the end of the 4-byte header, which tells the order of the bytes. A
sequence or string begins with its length. Up to three bytes may fill the message up at its end. Source: OMG, Common
Data Representation (plain CDR, XCDR1); the definitions are those of ros2/common_interfaces, apl-ocean-engineering's
marine_acoustic_msgs and paagutie's dvl_msgs.
"""

import struct
from functools import cache
from types import SimpleNamespace
from typing import Any, NamedTuple

from bottomlock.errors import DataError

DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/Float64": "float64 data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/PoseWithCovarianceStamped": "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose",
    "sensor_msgs/Imu": """
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
""",
    "sensor_msgs/FluidPressure": "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance",
    "sensor_msgs/NavSatStatus": "int8 status\nuint16 service",
    "sensor_msgs/NavSatFix": """
std_msgs/Header header
sensor_msgs/NavSatStatus status
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 position_covariance_type
""",
    "marine_acoustic_msgs/Dvl": """
std_msgs/Header header
uint8 velocity_mode
uint8 dvl_type
geometry_msgs/Vector3 velocity
float64[9] velocity_covar
float64 altitude
float64 course_gnd
float64 speed_gnd
uint8 num_good_beams
float32 sound_speed
bool beam_ranges_valid
bool beam_velocities_valid
geometry_msgs/Vector3[4] beam_unit_vec
float64[4] range
float32[4] range_covar
float32[4] beam_quality
float32[4] beam_velocity
float32[4] beam_velocity_covar
""",
    "dvl_msgs/DVLBeam": """
int64 id
float64 velocity
float64 distance
float64 rssi
float64 nsd
bool valid
""",
    "dvl_msgs/DVL": """
std_msgs/Header header
float64 time
geometry_msgs/Vector3 velocity
float64 fom
float64 altitude
dvl_msgs/DVLBeam[] beams
bool velocity_valid
int64 status
string form
""",
}
"""By type, as in a `.msg` file."""

LATER_DVL = """
std_msgs/Header header
float64 time
geometry_msgs/Vector3 velocity
float64 fom
float64[] covariance
float64 altitude
dvl_msgs/DVLBeam[] beams
bool velocity_valid
int64 status
int64 time_of_validity
int64 time_of_transmission
string form
"""
"""Of `dvl_msgs/DVL` in its later version."""

_CODES = {
    "bool": "?",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "float32": "f",
    "float64": "d",
}
_ORDER = {b"\x00\x01": "<", b"\x00\x00": ">"}
_HEADER_BYTES, _MOST_FILLING = 4, 3


class _Field(NamedTuple):
    """A field of a definition; `size` is that of an array, None of a sequence, 1 of a single value."""

    name: str
    type: str
    size: int | None
    single: bool


@cache
def _fields(definition: str) -> tuple[_Field, ...]:
    found = []
    for line in definition.split("\n"):
        if not line:
            continue
        type_name, name = line.split()
        element, bracket, digits = type_name.rstrip("]").partition("[")
        size = 1 if not bracket else int(digits) if digits else None
        found.append(_Field(name, element, size, not bracket))
    return tuple(found)


class _Reader:
    """Takes values from the body of a message, one after the other."""

    def __init__(self, data: bytes) -> None:
        order = _ORDER.get(data[:2])
        if order is None or len(data) < _HEADER_BYTES:
            raise DataError("does not begin as plain CDR does")
        self._order, self._body, self._at = order, memoryview(data)[_HEADER_BYTES:], 0

    def message(self, definition: str) -> SimpleNamespace:
        """The fields of a definition."""
        return SimpleNamespace(**{one.name: self._field(one) for one in _fields(definition)})

    def _field(self, field: _Field) -> Any:  # noqa: ANN401 - as the definition says
        try:
            count = self._number("I") if field.size is None else field.size
            code = _CODES.get(field.type)
            values: Any
            if code is not None:
                values = self._numbers(code, count)
            elif field.type == "string":
                values = [self._string() for _ in range(count)]
            else:
                values = [self.message(DEFINITIONS[field.type]) for _ in range(count)]
        except (struct.error, IndexError) as error:
            raise DataError(f"ends within '{field.name}'") from error
        return values[0] if field.single else values

    def _numbers(self, code: str, count: int) -> tuple[Any, ...]:
        size = struct.calcsize("<" + code)
        if count:
            self._at += -self._at % size
        # A length that is damaged must not be allocated.
        if self._at + size * count > len(self._body):
            raise IndexError
        values = struct.unpack_from(f"{self._order}{count}{code}", self._body, self._at)
        self._at += size * count
        return values

    def _number(self, code: str) -> int:
        return int(self._numbers(code, 1)[0])

    def _string(self) -> str:
        length = self._number("I")
        text = bytes(self._body[self._at : self._at + length])
        if len(text) < length:
            raise IndexError
        self._at += length
        return text.rstrip(b"\x00").decode("utf-8", "replace")

    def check_end(self) -> None:
        """Checks that nothing is left but bytes that fill the message up."""
        left = len(self._body) - self._at
        if left > _MOST_FILLING:
            raise DataError(f"has {left} bytes behind its last field")


def decode(data: bytes, name: str, definition: str | None = None) -> Any:  # noqa: ANN401 - as the definition says
    """A message, its fields as attributes: numbers, strings, messages, tuples of numbers, lists of messages.

    Args:
        data: as ROS 2 serialises it.
        name: its type, a key of `DEFINITIONS`.
        definition: another definition of the type than the one there.

    Raises:
        DataError: for bytes that are no message of this type.

    Examples:
        >>> import struct
        >>> decode(bytes([0, 1, 0, 0]) + struct.pack("<d", 12.5), "std_msgs/Float64").data
        12.5
    """
    try:
        reader = _Reader(data)
        message = reader.message(definition or DEFINITIONS[name])
        reader.check_end()
    except DataError as error:
        raise DataError(f"no {name}: {error}") from error
    return message


def stamp_ns(header: Any) -> int:  # noqa: ANN401 - `std_msgs/Header`, decoded here or by a library
    """Time of a header, ns since 1970."""
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
