"""Bags of Water Linked's drivers give the pings of the instrument's own JSON."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="bags need the extra .[ros]")

from bottomlock.io.formats import read_recording
from tests.io import bags

# As waterlinked/dvl-a50-ros-driver publishes them; the second with what the ROS 2 driver adds.
BEAM = "int64 id\nfloat64 velocity\nfloat64 distance\nfloat64 rssi\nfloat64 nsd\nbool valid\n"
DVL = (
    "std_msgs/Header header\nfloat64 time\ngeometry_msgs/Vector3 velocity\nfloat64 fom\nfloat64 altitude\n"
    "{package}/DVLBeam[] beams\nbool velocity_valid\nint64 status\nstring form\n"
)
EXTRA = "int64 time_of_validity\nint64 time_of_transmission\nfloat64[] covariance\n"


def registered(store: Any, package: str, more: str = "") -> str:  # noqa: ANN401 - the library's own objects
    """The name of the type, known to a store."""
    from rosbags.typesys import get_types_from_msg

    name = f"{package}/msg/DVL"
    store.register(get_types_from_msg(BEAM, f"{package}/msg/DVLBeam"))
    store.register(get_types_from_msg(DVL.format(package=package) + more, name))
    return name


def message(store: Any, name: str, step: int, **more: Any) -> Any:  # noqa: ANN401
    """A report; the third has lost beam 2, the fourth its velocity."""
    package = name.split("/", 1)[0]
    types = store.types
    beam = types[f"{package}/msg/DVLBeam"]
    speeds = bags.UNIT @ bags.VELOCITY + 1e-3 * step
    header = {
        "stamp": types["builtin_interfaces/msg/Time"](sec=1_700_000_000, nanosec=200_000_000 * step),
        "frame_id": "dvl",
    }
    if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__:
        header["seq"] = step
    return types[name](
        header=types["std_msgs/msg/Header"](**header), time=200.0,
        velocity=types["geometry_msgs/msg/Vector3"](*bags.VELOCITY), fom=0.003, altitude=2.5,
        beams=[
            beam(
                id=k, velocity=float(v), distance=2.7 + 0.1 * k, rssi=-40.0, nsd=-88.0, valid=(step, k) != (2, 1)
            )
            for k, v in enumerate(speeds)
        ],
        velocity_valid=step != 3, status=0, form="json_v3.1", **more,
    )  # fmt: skip


def write_ros2(path: Path, package: str, more: str = "", steps: int = 5, **values: Any) -> Path:  # noqa: ANN401
    """A ROS 2 bag with a topic of such messages."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    name = registered(store, package, more)
    with Writer(path, version=9) as writer:
        connection = writer.add_connection("/dvl/data", name, typestore=store)
        for step in range(steps):
            one = {key: value(step) for key, value in values.items()}
            raw = store.serialize_cdr(message(store, name, step, **one), name)
            writer.write(connection, 1_700_000_000_050_000_000 + 200_000_000 * step, raw)
    return path


def check(table: Any) -> None:  # noqa: ANN401
    np.testing.assert_array_equal(table.valid[:, 1], [True, True, False, True, True])
    np.testing.assert_allclose(table.velocity_mps[0], bags.UNIT @ bags.VELOCITY)
    np.testing.assert_allclose(table.range_m[0], [2.7, 2.8, 2.9, 3.0])
    np.testing.assert_array_equal(table.instrument_mps[0], bags.VELOCITY)
    np.testing.assert_array_equal(table.instrument_valid, [1, 1, 1, 0, 1])
    np.testing.assert_array_equal(np.isnan(table.extra["altitude_m"]), [False, False, False, True, False])


def test_a_ros1_bag_is_stamped_by_the_driver(tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    name = registered(store, "waterlinked_a50_ros_driver")
    with Writer(tmp_path / "dive.bag") as writer:
        connection = writer.add_connection("/dvl/data", name, typestore=store)
        for step in range(5):
            raw = store.serialize_ros1(message(store, name, step), name)
            writer.write(connection, 1_700_000_000_050_000_000 + 200_000_000 * step, raw)
    found = read_recording(tmp_path / "dive.bag")
    check(found.table)
    assert (found.time_of, found.geometry) == ("arrival", "waterlinked_a50")
    np.testing.assert_array_equal(found.table.time_ns, 1_700_000_000_000_000_000 + 200_000_000 * np.arange(5))
    assert "the stamp is when the driver received a report" in found.notes[0]


def test_a_time_of_validity_is_taken(tmp_path: Path) -> None:
    path = write_ros2(
        tmp_path / "dive", "dvl_msgs", EXTRA, time_of_validity=lambda k: 1_699_999_999_900_000 + 200_000 * k,
        time_of_transmission=lambda _: 0, covariance=lambda _: np.zeros(9),
    )  # fmt: skip
    found = read_recording(path)
    check(found.table)
    assert (found.time_of, found.notes) == ("validity", [])
    np.testing.assert_array_equal(found.table.time_ns, 1_699_999_999_900_000_000 + 200_000_000 * np.arange(5))
