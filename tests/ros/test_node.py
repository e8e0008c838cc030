"""The node in a small stand-in of rclpy: a bag played through it gives the bits of a replay; its states and mistakes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.io.beams import read_geometry
from bottomlock.kernel import normal_gravity_mps2
from bottomlock.live import navigation
from bottomlock.live.config import load_config
from bottomlock.live.replay import replay_log
from bottomlock.ports.estimate import Estimate
from bottomlock.ports.registry import port
from tests.ros import dive
from tests.ros.rclpy_stand_in import Graph, Node, TransitionCallbackReturn, node_module

pytest.importorskip("rosbags", reason="needs rosbags (extra ros)")

SECONDS = 120.0
SUCCESS = TransitionCallbackReturn.SUCCESS
BAG: dict[str, list[dive.Arrival]] = {}


@pytest.fixture(scope="module")
def bag(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bag of the dive."""
    path = tmp_path_factory.mktemp("bag") / "dive"
    directions = np.asarray(read_geometry("teledyne_30").geometry.directions_p)
    dive.write_bag(path, list(dive.arrivals(root, SECONDS, directions)))
    return path


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
    bag: Path, graph: Graph, module: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path  # noqa: ANN401
) -> None:
    """The kernel's replay of what the library reads from the bag, from the same start: every pose, twist, covariance."""
    begun: list[tuple[Any, ...]] = []

    def recorded(*args: Any, **settings: Any) -> Any:  # noqa: ANN401
        begun.append((*args, settings))
        return bottomlock.Navigator(*args, **settings)

    monkeypatch.setattr(navigation, "Navigator", recorded)
    played, read = dive.read_bag(bag)
    node = started(module)
    play(graph, played)
    assert node.change("deactivate") is SUCCESS
    odometry = [data for topic, _, data in graph.sent if topic == "/odometry"]
    assert len(odometry) > 1000
    ((geometry, model, options, start, settings),) = begun

    # What the bag holds, read by the library, in our axes.
    of = {topic: [message for name, message in read if name == topic] for topic in dive.TYPES}
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
    store = dive.Messages().store
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
    arrived = np.concatenate([times[topic] + dive.DELAYS_NS[topic] for topic in dive.TYPES if topic != "/imu"])
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
    return Estimate.from_state(
        {"time_ns": time_ns} | state,
        replayed["covariance"][0, row],
        omega_p_radps=log["omega_p_radps"][place],
    )
