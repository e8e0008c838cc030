"""Messages of ROS 2 read without ROS: as rosbags reads them, whatever stands in them, and damaged ones refused."""

from typing import Any

import numpy as np
import pytest

from bottomlock.errors import DataError
from bottomlock.io import ros as ros_reader
from bottomlock.io.ros_messages import DEFINITIONS, LATER_DVL, decode

rosbags = pytest.importorskip("rosbags.typesys", reason="needs rosbags (extra ros)")

READ = [
    name for name in DEFINITIONS if "Stamped" in name or name.split("/")[0] in {"sensor_msgs", "std_msgs"}
]
READ += ["marine_acoustic_msgs/Dvl", "dvl_msgs/DVL"]
VELOCITY = """
std_msgs/Header header
string body_frame_id
string reference_frame_id
geometry_msgs/TwistWithCovariance velocity
"""


def store_of(dvl: str = DEFINITIONS["dvl_msgs/DVL"]) -> Any:  # noqa: ANN401 - the library is not typed
    """The library's own definitions, and of `dvl_msgs` ours."""
    store = ros_reader.typestore()
    for name, text in (("dvl_msgs/msg/DVLBeam", DEFINITIONS["dvl_msgs/DVLBeam"]), ("dvl_msgs/msg/DVL", dvl)):
        store.register(rosbags.get_types_from_msg(text, name))
    store.register(rosbags.get_types_from_msg(VELOCITY, "geometry_msgs/msg/VelocityWithCovarianceStamped"))
    return store


def full_name(name: str) -> str:
    return name.replace("/", "/msg/")


def drawn(store: Any, name: str, random: np.random.Generator) -> Any:  # noqa: ANN401
    """A message of a type with random content."""
    definition = dict(store.fielddefs[name][1])
    return store.types[name](**{field: value(store, kind, random) for field, kind in definition.items()})


def value(store: Any, kind: Any, random: np.random.Generator) -> Any:  # noqa: ANN401
    node, of = int(kind[0]), kind[1]
    if node == 1:  # a single value
        if of[0] == "string":
            return "".join(chr(c) for c in random.integers(97, 123, random.integers(0, 9)))
        return value_of(of[0], 1, random)[0].item()
    if node == 2:  # a message
        return drawn(store, of, random)
    inner, count = of
    size = count if node == 3 else int(random.integers(0, 6))
    if int(inner[0]) == 1:
        return value_of(inner[1][0], size, random)
    return [value(store, inner, random) for _ in range(size)]


def value_of(code: str, size: int, random: np.random.Generator) -> Any:  # noqa: ANN401
    """Random numbers of a type."""
    if code == "bool":
        return random.integers(0, 2, size).astype(np.bool_)
    if code.startswith("float"):
        return random.normal(0.0, 100.0, size).astype(code)
    limits = np.iinfo(code)
    return random.integers(limits.min, limits.max, size, dtype=code, endpoint=True)


def equal(ours: Any, theirs: Any) -> bool:  # noqa: ANN401
    """Whether a message is the same in both readers."""
    if hasattr(theirs, "__dataclass_fields__"):
        names = [
            name for name in theirs.__dataclass_fields__ if not name.startswith("__") and not name.isupper()
        ]
        return list(vars(ours)) == names and all(equal(getattr(ours, n), getattr(theirs, n)) for n in names)
    if isinstance(theirs, list | np.ndarray):
        return len(ours) == len(theirs) and all(map(equal, ours, theirs))
    return bool(ours == theirs)


@pytest.mark.parametrize("little", [True, False])
@pytest.mark.parametrize("name", READ)
def test_as_the_library_reads_them(name: str, little: bool) -> None:
    """Random content in both orders of bytes, strings and sequences of every length; also filled up at its end."""
    store, random = store_of(), np.random.default_rng(7)
    for _ in range(30):
        message = drawn(store, full_name(name), random)
        data = bytes(store.serialize_cdr(message, full_name(name), little_endian=little))
        assert equal(decode(data, name), message)
        assert equal(decode(data + bytes(3), name), message)


@pytest.mark.parametrize("name", READ)
def test_a_message_that_ends_early_or_goes_on(name: str) -> None:
    """Cut at every byte, the field is named; four bytes more are too many."""
    store, random = store_of(), np.random.default_rng(8)
    data = bytes(store.serialize_cdr(drawn(store, full_name(name), random), full_name(name)))
    for length in range(len(data)):
        with pytest.raises(
            DataError, match=rf"^no {name}: (ends within '\w+'|does not begin as plain CDR does)$"
        ):
            decode(data[:length], name)
    with pytest.raises(DataError, match=r"has 4 bytes behind its last field"):
        decode(data + bytes(4), name)


def test_a_damaged_length_is_not_allocated() -> None:
    """A sequence or a string of four thousand million."""
    store, random = store_of(), np.random.default_rng(9)
    message = drawn(store, "dvl_msgs/msg/DVL", random)
    data = bytearray(store.serialize_cdr(message, "dvl_msgs/msg/DVL"))
    at = data.index(len(message.beams).to_bytes(4, "little"), 60)
    data[at : at + 4] = b"\xff\xff\xff\xff"
    with pytest.raises(DataError, match="ends within"):
        decode(bytes(data), "dvl_msgs/DVL")
    with pytest.raises(DataError, match="ends within 'frame_id'"):
        decode(b"\x00\x01\x00\x00" + bytes(8) + b"\xff\xff\xff\xff", "sensor_msgs/Imu")


def test_the_later_version_of_a_message() -> None:
    store, random = store_of(LATER_DVL), np.random.default_rng(10)
    for _ in range(30):
        message = drawn(store, "dvl_msgs/msg/DVL", random)
        data = bytes(store.serialize_cdr(message, "dvl_msgs/msg/DVL"))
        assert equal(decode(data, "dvl_msgs/DVL", LATER_DVL), message)
