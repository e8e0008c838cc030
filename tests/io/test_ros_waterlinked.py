"""Bags of Water Linked's drivers give the pings of the instrument's own JSON."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="bags need the extra .[ros]")

from bottomlock.io.formats import read_recording
from tests.io import bags
from tests.ros_messages import Messages, write_ros1, write_ros2

STAMP_NS = 1_700_000_000_000_000_000

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
    return types[name](
        header=Messages(store).header(STAMP_NS + 200_000_000 * step, "dvl"), time=200.0,
        velocity=types["geometry_msgs/msg/Vector3"](*bags.VELOCITY), fom=0.003, altitude=2.5,
        beams=[
            beam(
                id=k, velocity=float(v), distance=2.7 + 0.1 * k, rssi=-40.0, nsd=-88.0, valid=(step, k) != (2, 1)
            )
            for k, v in enumerate(speeds)
        ],
        velocity_valid=step != 3, status=0, form="json_v3.1", **more,
    )  # fmt: skip


def check(table: Any) -> None:  # noqa: ANN401
    np.testing.assert_array_equal(table.valid[:, 1], [True, True, False, True, True])
    np.testing.assert_allclose(table.velocity_mps[0], bags.UNIT @ bags.VELOCITY)
    np.testing.assert_allclose(table.range_m[0], [2.7, 2.8, 2.9, 3.0])
    np.testing.assert_array_equal(table.instrument_mps[0], bags.VELOCITY)
    np.testing.assert_array_equal(table.instrument_valid, [1, 1, 1, 0, 1])
    np.testing.assert_array_equal(np.isnan(table.extra["altitude_m"]), [False, False, False, True, False])


def test_a_ros1_bag_is_stamped_by_the_driver(tmp_path: Path) -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    name = registered(store, "waterlinked_a50_ros_driver")
    sent = [(bags.FIRST_NS + 200_000_000 * k, "/dvl/data", name, message(store, name, k)) for k in range(5)]
    found = read_recording(write_ros1(tmp_path / "dive.bag", sent, store))
    check(found.table)
    assert (found.time_of, found.geometry) == ("arrival", "waterlinked_a50")
    np.testing.assert_array_equal(found.table.time_ns, 1_700_000_000_000_000_000 + 200_000_000 * np.arange(5))
    assert "the stamp is when the driver received a report" in found.notes[0]


def test_a_time_of_validity_is_taken(tmp_path: Path) -> None:
    made = Messages()
    name = registered(made.store, "dvl_msgs", EXTRA)
    sent = []
    for k in range(5):
        valid_us = 1_699_999_999_900_000 + 200_000 * k
        more = {"time_of_validity": valid_us, "time_of_transmission": 0, "covariance": np.zeros(9)}
        report = message(made.store, name, k, **more)
        sent.append((bags.FIRST_NS + 200_000_000 * k, "/dvl/data", name, report))
    found = read_recording(write_ros2(tmp_path / "dive", sent, made.store, mcap=False))
    check(found.table)
    assert (found.time_of, found.notes) == ("validity", [])
    np.testing.assert_array_equal(found.table.time_ns, 1_699_999_999_900_000_000 + 200_000_000 * np.arange(5))
