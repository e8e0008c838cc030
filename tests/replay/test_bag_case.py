"""`replay --init` of a bag: IMU, depth, fixes, poses and velocities by their topics, beams of a driver's messages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

pytest.importorskip("rosbags", reason="bags need the extra .[ros]")

from bottomlock.replay.case import load_case
from bottomlock.replay.init.bag import bag_tables
from bottomlock.replay.init.make import make_case
from bottomlock.replay.run import replay_case
from tests.dive import Dive, drawn_dive
from tests.io.test_ros_waterlinked import registered

START_NS = 1_700_000_000_000_000_000


def write_bag(dive: Dive, path: Path, *, beams: bool = True, fixes: int = 40) -> Path:
    """A ROS 2 bag in MCAP: IMU in forward, left, up; depth without header; USBL in east, north, up; a DVL."""
    from rosbags.rosbag2 import Writer
    from rosbags.rosbag2.enums import StoragePlugin
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.LATEST)
    t = store.types
    vector, point = t["geometry_msgs/msg/Vector3"], t["geometry_msgs/msg/Point"]
    quaternion, pose = t["geometry_msgs/msg/Quaternion"], t["geometry_msgs/msg/Pose"]
    messages: list[tuple[int, str, str, Any]] = []

    def header(ns: int, frame: str) -> Any:  # noqa: ANN401
        stamp = t["builtin_interfaces/msg/Time"](sec=ns // 1_000_000_000, nanosec=ns % 1_000_000_000)
        return t["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)

    flu = np.array([1.0, -1.0, -1.0])
    for k, (second, w, f) in enumerate(zip(dive.imu_s, dive.omega * flu, dive.force * flu, strict=True)):
        ns = START_NS + round(second * 1e9)
        unknown = np.full(9, -1.0)
        imu = t["sensor_msgs/msg/Imu"](
            header(ns, "base_link"), quaternion(0.0, 0.0, 0.0, 1.0), unknown, vector(*w), np.zeros(9), vector(*f),
            np.zeros(9),
        )  # fmt: skip
        messages.append((ns, "/imu/data", "sensor_msgs/msg/Imu", imu))
        if k % 5 == 0:
            north, east, down = dive.position[k]
            messages.append((ns + 3, "/depth", "std_msgs/msg/Float64", t["std_msgs/msg/Float64"](down)))
            if k % 50 == 0:
                there = pose(point(east, north, -down), quaternion(0.0, 0.0, 0.0, 1.0))
                usbl = t["geometry_msgs/msg/PoseWithCovarianceStamped"](
                    header(ns, "map"), t["geometry_msgs/msg/PoseWithCovariance"](there, np.zeros(36))
                )
                messages.append((ns, "/usbl/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", usbl))
            state = t["sensor_msgs/msg/NavSatStatus"](0 if k < 5 * fixes else -1, 1)
            fix = t["sensor_msgs/msg/NavSatFix"](header(ns, "gps"), state, 45.0, 10.0, 0.0, np.zeros(9), 0)
            messages.append((ns, "/gps/fix", "sensor_msgs/msg/NavSatFix", fix))
    dvl = registered(store, "dvl_msgs") if beams else "geometry_msgs/msg/TwistWithCovarianceStamped"
    from bottomlock.io.beams import read_geometry

    inverse = np.linalg.pinv(np.asarray(read_geometry(dive.geometry).geometry.directions_p))
    for second, four in zip(dive.ping_s, dive.beams, strict=True):
        ns = START_NS + round(second * 1e9)
        whole = bool(np.isfinite(four).all())
        v = inverse @ np.nan_to_num(four)
        if beams:
            one = t["dvl_msgs/msg/DVLBeam"]
            each = [
                one(k, float(np.nan_to_num(b)), 4.0, -40.0, -88.0, bool(np.isfinite(b)))
                for k, b in enumerate(four)
            ]
            sent = t[dvl](header(ns, "dvl"), 250.0, vector(*v), 0.003, 3.7, each, whole, 0, "json_v3.1")
        elif whole:
            twist = t["geometry_msgs/msg/Twist"](vector(*(v * flu)), vector(0.0, 0.0, 0.0))
            sent = t[dvl](header(ns, "dvl"), t["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)))
        else:
            continue
        messages.append((ns, "/dvl/data", dvl, sent))
    messages.sort(key=lambda one: one[0])
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {topic: kind for _, topic, kind, _ in messages}
        connections = {
            topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in topics.items()
        }
        for ns, topic, kind, message in messages:
            writer.write(connections[topic], ns, store.serialize_cdr(message, kind))
    return path


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
    row = replay_case(case.with_methods(["tc"])).runs.filter(pl.col("pass") == "forward").row(0, named=True)
    assert row["fixes_rejected"] == 0
    # No attitude was recorded: the heading is found from the positions alone, if at all.
    assert row["nis_mean_over_fixes"] / row["nis_degrees_mean_over_fixes"] < 3.0


def test_a_bag_that_breaks_off_gives_what_it_held(tmp_path: Path) -> None:
    """The third message is cut: the first two are a table that says so."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    t, kind = store.types, "geometry_msgs/msg/PointStamped"
    with Writer(tmp_path / "x.bag") as writer:
        connection = writer.add_connection("/lbl", kind, typestore=store)
        for k in range(3):
            header = t["std_msgs/msg/Header"](
                k, t["builtin_interfaces/msg/Time"](1_700_000_000 + k, 0), "ned"
            )
            raw = store.serialize_ros1(t[kind](header, t["geometry_msgs/msg/Point"](1.0 + k, 2.0, 3.0)), kind)
            writer.write(connection, START_NS + k, bytes(raw)[: 20 if k == 2 else None])
    (found,) = bag_tables(tmp_path / "x.bag")
    assert found.remark.startswith("the bag breaks off (")
    assert found.frame.to_dict(as_series=False) == {
        "time_ns": [START_NS, START_NS + 1_000_000_000], "north": [1.0, 2.0], "east": [2.0, 2.0], "down": [3.0, 3.0],
    }  # fmt: skip
