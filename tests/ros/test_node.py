"""The node in a small stand-in of rclpy: a bag gives the bits of a replay; states, transitions and mistakes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import normal_gravity_mps2
from bottomlock.live import aligned
from bottomlock.live.config import load_config
from bottomlock.live.raw_log import ReadLog
from bottomlock.live.replay import replay_log
from bottomlock.ports.estimate import Estimate
from bottomlock.ports.registry import port
from tests.ros import dive
from tests.ros.rclpy_stand_in import Graph, Node, TransitionCallbackReturn, node_module
from tests.ros_messages import Messages

pytest.importorskip("rosbags", reason="needs rosbags (extra ros)")

SECONDS = 120.0
SUCCESS = TransitionCallbackReturn.SUCCESS


@pytest.fixture(scope="module")
def read(
    root: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[dive.Arrival], list[tuple[str, Any]]]:
    """What the bag of the dive holds, as bytes and as messages."""
    path = tmp_path_factory.mktemp("bag") / "dive"
    directions = np.asarray(read_geometry("teledyne_30").geometry.directions_p)
    dive.write_bag(path, list(dive.arrivals(root, SECONDS, directions)))
    return dive.read_bag(path)


@pytest.fixture
def played(read: tuple[list[dive.Arrival], Any]) -> list[dive.Arrival]:
    """The bytes of the bag."""
    return read[0]


@pytest.fixture
def graph(tmp_path: Path) -> Graph:
    """What is beyond the node, with a configuration whose raw log is in a folder beside it."""
    file = tmp_path / "dive.toml"
    file.write_text(dive.CONFIG + '[log]\nfolder = "logs"\n')
    return Graph({"config": str(file)})


@pytest.fixture
def module(graph: Graph) -> Iterator[Any]:
    with node_module(graph) as found:
        yield found
        for node in list(graph.nodes):
            node.destroy_node()


def started(module: Any) -> Node:  # noqa: ANN401
    node: Node = module.BottomlockNode()
    assert node.change("configure") is SUCCESS
    assert node.change("activate") is SUCCESS
    return node


def play(graph: Graph, played: list[dive.Arrival]) -> None:
    """Plays a bag with its clock."""
    for one in played:
        graph.at(one.time_ns)
        graph.publish(one.topic, one.data)


def test_a_bag_gives_the_bits_of_a_replay(
    read: tuple[list[dive.Arrival], list[tuple[str, Any]]],
    graph: Graph,
    module: Any,  # noqa: ANN401
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """The kernel's replay of what the library reads from the bag, from the same start: poses, twists, covariances."""
    begun: list[tuple[Any, ...]] = []

    def recorded(*args: Any, **settings: Any) -> Any:  # noqa: ANN401
        begun.append((*args, settings))
        return bottomlock.Navigator(*args, **settings)

    monkeypatch.setattr(aligned, "Navigator", recorded)
    played, messages = read
    node = started(module)
    play(graph, played)
    assert node.change("deactivate") is SUCCESS
    odometry = [data for topic, _, data in graph.sent if topic == "/odometry"]
    assert len(odometry) > 1000
    ((geometry, model, options, start, settings),) = begun

    # What the bag holds, read by the library, in our axes.
    of = {topic: [message for name, message in messages if name == topic] for topic in dive.TYPES}
    times = {topic: np.array([stamp(message) for message in of[topic]]) for topic in of}
    frd = np.array([1.0, -1.0, -1.0])
    velocity = np.array([message.beam_velocity for message in of["/dvl"]]).astype(np.float64)
    gravity = normal_gravity_mps2(np.deg2rad(dive.LATITUDE_DEG))
    usbl = [message.pose for message in of["/usbl"]]
    log: Any = {
        "imu_time_ns": times["/imu"],
        "omega_p_radps": np.array([xyz(message.angular_velocity) for message in of["/imu"]]) * frd,
        "force_p_mps2": np.array([xyz(message.linear_acceleration) for message in of["/imu"]]) * frd,
        "dvl_time_ns": times["/dvl"],
        "beam_velocity_mps": velocity,
        "beam_valid": np.isfinite(velocity),
        "beam_sd_mps": np.tile(read_geometry("teledyne_30").beam_sd_mps, (len(velocity), 1)),
        "depth_time_ns": times["/pressure"],
        "depth_m": (np.array([message.fluid_pressure for message in of["/pressure"]]) - dive.SURFACE_PA)
        / (dive.DENSITY * gravity),
        "acoustic_position_time_ns": times["/usbl"],
        "acoustic_position_t_m": np.array(
            [[one.pose.position.y, one.pose.position.x, -one.pose.position.z] for one in usbl]
        ),
        "acoustic_position_sd_m": np.tile(np.sqrt([1.0, 1.21, 2.25]), (len(usbl), 1)),
    }
    store = Messages().store
    stamps = [stamp(store.deserialize_cdr(data, "nav_msgs/msg/Odometry")) for data in odometry]
    replayed: Any = bottomlock.replay_log(
        geometry,
        model,
        options,
        [settings["method"]],
        log,
        start,
        sample_time_ns=np.array(stamps),
        covariances=True,
    )
    assert replayed["sample_time_ns"].tolist() == stamps
    arrived = np.concatenate(
        [times[topic] + dive.DELAYS_NS[topic] for topic in dive.TYPES if topic != "/imu"]
    )
    measured = np.concatenate([times[topic] for topic in dive.TYPES if topic != "/imu"])
    encode = port("ros_odometry")
    same = compared = 0
    for row, (time_ns, data) in enumerate(zip(stamps, odometry, strict=True)):
        # While a measurement of its past is on its way, an estimate is without it, and a replay has it.
        pending = (measured <= time_ns) & (arrived > time_ns + dive.DELAYS_NS["/imu"])
        expected = encode.encode(estimate_of(replayed, row, time_ns, log))
        if not pending.any():
            compared += 1
            assert data == expected, f"odometry {row} at {time_ns}"
        same += data == expected
    assert compared > 500
    assert same < len(odometry)

    # The raw log gives them again.
    (raw,) = (tmp_path / "logs").glob("*.mcap")
    again = replay_log(load_config(graph.parameters["config"]), raw)
    assert again.first_difference == ""
    assert [one.data for one in again.messages if one.port == 0] == odometry


def stamp(message: Any) -> int:  # noqa: ANN401
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def xyz(vector: Any) -> list[float]:  # noqa: ANN401
    return [vector.x, vector.y, vector.z]


def estimate_of(replayed: Any, row: int, time_ns: int, log: Any) -> Estimate:  # noqa: ANN401
    """A row of a replay as what the ports are given; the rates are those of the last reading."""
    state = {key: replayed[key][0, row] for key in ("position_t_m", "attitude_t_p", "velocity_p_mps")}
    place = int(np.searchsorted(log["imu_time_ns"], time_ns))
    joint = replayed["covariance"][0, row, :9, :9]
    joint = 0.5 * (joint + joint.T)
    return Estimate(
        time_ns=time_ns,
        mode="navigation",
        covariance_m2ps2=joint[6:, 6:],
        navigation_covariance=joint,
        rank=0,
        omega_p_radps=log["omega_p_radps"][place],
        **state,
    )


def test_what_is_published(played: list[dive.Arrival], graph: Graph, module: Any) -> None:  # noqa: ANN401
    """Types, axes, /tf equal to the odometry of its time; no pose before the alignment, diagnostics always."""
    node = started(module)
    play(graph, played[:800])
    store = Messages().store
    types = {topic: name for topic, name, _ in graph.sent}
    assert types == {
        "/odometry": "nav_msgs/msg/Odometry",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    }
    poses = {}
    levels = []
    for topic, name, data in graph.sent:
        message = store.deserialize_cdr(data, name)
        # The library writes the same bytes.
        assert bytes(store.serialize_cdr(message, name)) == data
        if topic == "/odometry":
            assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
            poses[stamp(message)] = message.pose.pose
        elif topic == "/tf":
            (found,) = message.transforms
            assert (found.header.frame_id, found.child_frame_id) == ("odom", "base_link")
            pose = poses[stamp(found)]
            assert xyz(found.transform.translation) == xyz(pose.position)
            assert found.transform.rotation == pose.orientation
        else:
            by_name = {one.name: one for one in message.status}
            assert list(by_name) == [
                "dive: navigation",
                *(f"dive: source {name}" for name in ("dvl", "imu", "pressure", "usbl")),
                "dive: port ros_odometry to ros:/odometry",
                "dive: port ros_tf to ros:/tf",
            ]
            levels.append(
                (by_name["dive: navigation"].message.split(":")[0], by_name["dive: navigation"].level)
            )
    # The alignment needs 5 s of inertial readings, the state OK a ping.
    assert [topic for topic, _, _ in graph.sent].index("/odometry") > 3
    assert levels[0] == ("INITIALISING", 1)
    assert ("OK", 0) in levels
    assert node.subscriptions[0].qos.reliability.name == "BEST_EFFORT"
    assert node.lifecycle_publishers[0].qos.reliability.name == "RELIABLE"


def test_unsafe_sends_diagnostics_alone(played: list[dive.Arrival], graph: Graph, module: Any) -> None:  # noqa: ANN401
    """Inertial readings that end: ERROR, with the reason, and no pose any more."""
    started(module)
    play(graph, played[:800])
    end_ns = played[799].time_ns
    graph.sent.clear()
    play(
        graph,
        [one for one in played if one.topic != "/imu" and end_ns + 10**9 < one.time_ns < end_ns + 8 * 10**9],
    )
    assert {topic for topic, _, _ in graph.sent} == {"/diagnostics"}
    store = Messages().store
    status = store.deserialize_cdr(graph.sent[-1][2], "diagnostic_msgs/msg/DiagnosticArray").status
    assert status[0].level == 2
    assert status[0].message.startswith("UNSAFE: no inertial readings for ")
    assert status[2].level == 3  # the source of inertial readings is stale
    assert status[2].message == "silent"


def test_time_of_a_simulation(played: list[dive.Arrival], graph: Graph, module: Any, tmp_path: Path) -> None:  # noqa: ANN401
    """Nothing is taken before the first /clock; a bag that plays again begins an estimate and a raw log anew."""
    started(module)
    assert graph.publish(played[0].topic, played[0].data) == 1
    assert not (tmp_path / "logs").exists()
    play(graph, played[:600])
    first = [data for topic, _, data in graph.sent if topic == "/odometry"]
    # A little back, as where a clock is set by a little: held.
    graph.at(graph.now_ns - 1_000_000)
    graph.publish(played[600].topic, played[600].data)
    assert graph.words("warning") == ""
    graph.sent.clear()
    play(graph, played[:600])
    assert "the clock went back by" in graph.words("warning")
    assert [data for topic, _, data in graph.sent if topic == "/odometry"] == first
    first_log, _ = sorted((tmp_path / "logs").glob("*.mcap"))
    times = [entry.time_ns for entry in ReadLog(first_log).entries()]
    assert times == sorted(times)


def test_transitions(played: list[dive.Arrival], graph: Graph, module: Any) -> None:  # noqa: ANN401
    """An inactive node takes and sends nothing; it can be activated again, and configured anew."""
    node = module.BottomlockNode()
    assert node.change("configure") is SUCCESS
    graph.at(played[0].time_ns)
    assert graph.publish("/imu", played[0].data) == 0
    for _ in range(2):
        assert node.change("activate") is SUCCESS
        play(graph, played[:600])
        assert node.change("deactivate") is SUCCESS
        assert (node.subscriptions, node.timers) == ([], [])
    sent = [data for topic, _, data in graph.sent if topic == "/odometry"]
    assert sent[: len(sent) // 2] == sent[len(sent) // 2 :]
    assert node.change("cleanup") is SUCCESS
    assert node.lifecycle_publishers == []
    assert node.change("configure") is SUCCESS
    node.destroy_node()
    assert graph.nodes == []


def test_damaged_messages_are_counted(played: list[dive.Arrival], graph: Graph, module: Any) -> None:  # noqa: ANN401
    """Half a message, one of another type, and none: diagnostics say how many and why; the estimate goes on."""
    node = started(module)
    play(graph, played[:600])
    graph.publish("/dvl", next(one.data for one in played if one.topic == "/dvl")[:100])
    graph.publish("/imu", b"")
    graph.at(graph.now_ns + 10**9)
    play(graph, played[600:1500])
    status = (
        Messages()
        .store.deserialize_cdr(
            next(data for topic, _, data in reversed(graph.sent) if topic == "/diagnostics"),
            "diagnostic_msgs/msg/DiagnosticArray",
        )
        .status
    )
    values = [{one.key: one.value for one in part.values} for part in status]
    assert values[1]["skipped no marine_acoustic_msgs/Dvl: ends within 'velocity_covar'"] == "1"
    assert values[2]["skipped no sensor_msgs/Imu: does not begin as plain CDR does"] == "1"
    assert status[0].level == 0
    assert node.state == "active"


def test_a_checkpoint(played: list[dive.Arrival], graph: Graph, module: Any, tmp_path: Path) -> None:  # noqa: ANN401
    """Saved while it runs; a node that starts within its age goes on from it, with the next reset counter."""
    file = Path(graph.parameters["config"])
    file.write_text(file.read_text() + '[checkpoint]\nfile = "dive.checkpoint"\n')
    node = started(module)
    play(graph, played[:800])
    node.destroy_node()
    assert (tmp_path / "dive.checkpoint").is_file()
    graph.sent.clear()
    started(module)
    play(graph, played[800:900])
    assert "/odometry" in {topic for topic, _, _ in graph.sent}


def test_whatever_is_raised_is_logged(
    played: list[dive.Arrival],
    graph: Graph,
    module: Any,  # noqa: ANN401
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a transition, after which the node can be configured again, and of a message: the next is taken."""

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("planted")

    node = module.BottomlockNode()
    assert node.change("configure") is SUCCESS
    with monkeypatch.context() as patch:
        patch.setattr(node, "create_subscription", broken)
        assert node.change("activate") is not SUCCESS
    assert "ZeroDivisionError: planted" in graph.words("error")
    assert node.change("configure") is SUCCESS
    assert node.change("activate") is SUCCESS
    play(graph, played[:10])
    graph.said.clear()
    with monkeypatch.context() as patch:
        patch.setattr(node, "_running", broken)
        play(graph, played[10:11])
    assert "ZeroDivisionError: planted" in graph.words("error")
    play(graph, played[11:20])
