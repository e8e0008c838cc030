"""`replay --init` of a bag: IMU, depth, fixes, poses and velocities by their topics, beams of a driver's messages."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="bags need the extra .[ros]")

from bottomlock.replay.case import load_case
from bottomlock.replay.init.make import make_case
from bottomlock.replay.init.sources import bag_tables
from tests.dive import Dive, drawn_dive
from tests.io.test_ros_waterlinked import registered
from tests.replay.undiagnosed import tc_row
from tests.ros_messages import IMU, POSE, Messages, write_ros1, write_ros2

START_NS = 1_700_000_000_000_000_000


def write_bag(dive: Dive, path: Path, *, beams: bool = True) -> Path:
    """A ROS 2 bag in MCAP: IMU in forward, left, up; depth without header; USBL in east, north, up; a DVL."""
    made = Messages()
    t, flu = made.types, np.array([1.0, -1.0, -1.0])
    sent: list[tuple[int, str, str, Any]] = []
    for k, (second, w, f) in enumerate(zip(dive.imu_s, dive.omega * flu, dive.force * flu, strict=True)):
        ns = START_NS + round(second * 1e9)
        sent.append((ns, "/imu/data", IMU, made.imu(ns, w, f)))
        if k % 5 == 0:
            north, east, down = dive.position[k]
            sent.append((ns + 3, "/depth", "std_msgs/msg/Float64", t["std_msgs/msg/Float64"](down)))
            if k % 50 == 0:
                sent.append((ns, "/usbl/pose", POSE, made.usbl(ns, north, east, down, (0.0, 0.0, 0.0))))
            state = t["sensor_msgs/msg/NavSatStatus"](0 if k < 200 else -1, 1)
            fix = t["sensor_msgs/msg/NavSatFix"](
                made.header(ns, "gps"), state, 45.0, 10.0, 0.0, np.zeros(9), 0
            )
            sent.append((ns, "/gps/fix", "sensor_msgs/msg/NavSatFix", fix))
    name = registered(made.store, "dvl_msgs") if beams else "geometry_msgs/msg/TwistWithCovarianceStamped"
    for second, four, v in zip(dive.ping_s, dive.beams, dive.instrument, strict=True):
        ns, good = START_NS + round(second * 1e9), np.isfinite(four)
        if beams:
            each = [
                t["dvl_msgs/msg/DVLBeam"](k, float(np.nan_to_num(b)), 4.0, -40.0, -88.0, bool(good[k]))
                for k, b in enumerate(four)
            ]
            own, whole = made.vector(*np.nan_to_num(v)), bool(good.all())
            report = t[name](made.header(ns, "dvl"), 250.0, own, 0.003, 3.7, each, whole, 0, "json_v3.1")
        elif good.all():
            twist = t["geometry_msgs/msg/Twist"](made.vector(*(v * flu)), made.vector(0.0, 0.0, 0.0))
            report = t[name](
                made.header(ns, "dvl"), t["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
            )
        else:
            continue
        sent.append((ns, "/dvl/data", name, report))
    return write_ros2(path, sent, made.store)


@pytest.fixture(scope="module")
def dive() -> Dive:
    return drawn_dive(3, seconds=120.0)


def test_topics_become_tables(dive: Dive, tmp_path: Path) -> None:
    """Rows without a fix are none; a pose whose attitude is the identity has none; a number has the bag's time."""
    tables = {one.part: one for one in bag_tables(write_bag(dive, tmp_path / "bag", beams=False))}
    assert tables.keys() == {"/imu/data", "/depth", "/usbl/pose", "/gps/fix", "/dvl/data"}
    assert tables["/gps/fix"].frame.height == 40
    assert tables["/usbl/pose"].frame.columns == ["time_ns", "east", "north", "down"]
    np.testing.assert_allclose(tables["/usbl/pose"].frame["down"], dive.position[::50, 2])
    assert tables["/depth"].frame["time_ns"][0] == START_NS + 3
    assert tables["/depth"].remark == "stamped by the bag, since the message has no time"
    velocity = tables["/dvl/data"].frame
    body = dive.at((velocity["time_ns"].to_numpy() - START_NS) * 1e-9, dive.velocity)
    left = velocity.select("surge_mps", "sway_mps", "heave_mps").to_numpy() - body
    assert float(np.sqrt(np.mean(left**2))) < 0.02


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("beams", [True, False])
def test_a_bag_makes_a_case_that_runs(dive: Dive, tmp_path: Path, beams: bool) -> None:
    path = write_bag(dive, tmp_path / "bag", beams=beams)
    made = make_case([path], tmp_path / "case.toml", without=("/gps/fix",))
    assert any("/usbl/pose: local" in one for one in made.words)
    case = load_case(tmp_path / "case.toml")
    assert case.readings.axes == ("x", "-y", "-z")
    assert case.dvl.source == ("beams" if beams else "velocity")
    row = tc_row(case)
    assert row["fixes_rejected"] == 0
    # No attitude was recorded: the heading is found from the positions alone, if at all.
    assert row["nis_mean_over_fixes"] / row["nis_degrees_mean_over_fixes"] < 3.0


def test_a_bag_that_breaks_off_gives_what_it_held(tmp_path: Path) -> None:
    """The third message is cut: the first two are a table that says so."""
    from rosbags.typesys import Stores, get_typestore

    made, kind, sent = Messages(get_typestore(Stores.ROS1_NOETIC)), "geometry_msgs/msg/PointStamped", []
    for k in range(3):
        place = made.types["geometry_msgs/msg/Point"](1.0 + k, 2.0, 3.0)
        point = made.types[kind](made.header(START_NS + k * 10**9, "ned"), place)
        raw = bytes(made.store.serialize_ros1(point, kind))[: 20 if k == 2 else None]
        sent.append((START_NS + k, "/lbl", kind, raw))
    write_ros1(tmp_path / "x.bag", sent, made.store)
    (found,) = bag_tables(tmp_path / "x.bag")
    assert found.remark.startswith("the bag breaks off (")
    assert found.frame.to_dict(as_series=False) == {
        "time_ns": [START_NS, START_NS + 1_000_000_000], "north": [1.0, 2.0], "east": [2.0, 2.0], "down": [3.0, 3.0],
    }  # fmt: skip
