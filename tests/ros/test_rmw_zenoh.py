"""`bottomlock live` among topics of ROS 2 by zenoh: with zenoh-ros2-sdk in another process, and what its keys hold."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bottomlock.errors import DataError
from bottomlock.live.config import parse_config
from bottomlock.live.connections import cancel
from bottomlock.live.engine import Engine
from bottomlock.live.rmw_zenoh import HASHES, Topic, attachment, domain
from bottomlock.live.ros_diagnostics import ROS_TYPE
from bottomlock.live.runner import Live
from bottomlock.live.sections import ROS_TYPES
from bottomlock.ports.registry import PORTS
from tests.live.processes import free_port
from tests.ros.dive import CONFIG

ODOMETRY = "RIHS01_" + HASHES["nav_msgs/Odometry"]


@contextmanager
def router(port: int) -> Iterator[None]:
    """As `ros2 run rmw_zenoh_cpp rmw_zenohd`: the sessions of both processes meet there."""
    zenoh = pytest.importorskip("zenoh", reason="needs eclipse-zenoh (extra zenoh)")
    settings = zenoh.Config()
    settings.insert_json5("mode", '"router"')
    settings.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
    settings.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(settings)
    try:
        yield
    finally:
        session.close()


@pytest.mark.slow
def test_two_processes(tmp_path: Path, root: Path) -> None:
    """Sensors in, odometry, transform, diagnostics out, by keys that the other side makes itself."""
    pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk (group others)")
    pytest.importorskip("rosbags", reason="needs rosbags (extra ros)")
    port = free_port(socket.SOCK_STREAM)
    text = CONFIG.replace('"ros:/dvl"', f'"ros:/dvl@tcp/127.0.0.1:{port}"')
    for topic in ("imu", "pressure", "usbl", "odometry", "tf", "diagnostics"):
        text = text.replace(f'"ros:/{topic}"', f'"ros:/{topic}@tcp/127.0.0.1:{port}"')
    text = text.replace("window_s = 5.0", "window_s = 1.0").replace("velocity_mps = [1.97, 0.34, -0.01]", "")
    text = text.replace('velocity = "given"', 'velocity = "beams"').replace("20.0]", "12.0]")
    file = tmp_path / "live.toml"
    file.write_text(text + "[health]\nport = 0\n")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([os.environ.get("PYTHONPATH", ""), str(root)])}
    environment.pop("ROS_DOMAIN_ID", None)
    command = [sys.executable, "-m", "bottomlock", "live", str(file)]
    with router(port):
        live = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
        try:
            partner = subprocess.run(
                [sys.executable, "-m", "tests.ros.sdk_partner", str(port), "6"],
                env=environment,
                cwd=root,
                capture_output=True,
                text=True,
                timeout=90,
                check=False,
            )
        finally:
            live.send_signal(signal.SIGINT)
            _, said = live.communicate(timeout=20)
    assert partner.returncode == 0, partner.stderr + said
    seen = json.loads(partner.stdout.splitlines()[-1])
    assert seen["state"] == "OK"
    assert seen["velocity"] == pytest.approx([1.5, -0.1, 0.0], abs=0.05)
    assert seen["depth"] == pytest.approx(-12.0, abs=0.1)
    assert abs(seen["age_s"]) < 5.0
    assert abs(seen["sent_s"][0]) < 5.0
    assert seen["received"]["/odometry"] > 40
    assert seen["received"]["/tf"] > 10
    assert seen["received"]["/diagnostics"] >= 4
    # What stood beside the messages: their numbers one after the other, of one publisher.
    first = seen["numbers"][0]
    assert seen["numbers"] == list(range(first, first + len(seen["numbers"])))
    assert len(seen["gids"]) == 1
    assert len(seen["gids"][0]) == 32
    # The graph, as `ros2 topic list -t` and `ros2 topic info -v` would show it.
    assert seen["topics"] == {
        "/odometry": ["nav_msgs/msg/Odometry"],
        "/tf": ["tf2_msgs/msg/TFMessage"],
        "/diagnostics": ["diagnostic_msgs/msg/DiagnosticArray"],
    }
    assert seen["publishers"]["/odometry"] == [f"bottomlock {ODOMETRY}"]
    assert "internal error" not in said


@pytest.mark.slow
def test_a_router_that_comes_late_and_comes_again() -> None:
    """The node is in the graph as soon as there is a router, again after its restart, and no more after the end."""
    zenoh = pytest.importorskip("zenoh", reason="needs eclipse-zenoh (extra zenoh)")
    port = free_port(socket.SOCK_STREAM)
    text = re.sub(r'"ros:(/\w+)"', rf'"ros:\1@tcp/127.0.0.1:{port}"', CONFIG)
    config = parse_config(text, place="test")

    def tokens() -> int:
        settings = zenoh.Config()
        settings.insert_json5("mode", '"client"')
        settings.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
        settings.insert_json5("scouting/multicast/enabled", "false")
        session = zenoh.open(settings)
        try:
            return len(
                [reply for reply in session.liveliness().get("@ros2_lv/0/**", timeout=2.0) if reply.ok]
            )
        finally:
            session.close()

    async def known(number: int) -> None:
        async with asyncio.timeout(40.0):
            while await asyncio.to_thread(tokens) != number:  # noqa: ASYNC110 - what is waited for has no event
                await asyncio.sleep(0.2)

    async def run() -> None:
        live = Live(config, Engine(config), say=lambda _: None, clock=time.time_ns)
        task = asyncio.create_task(live.run())
        try:
            await asyncio.sleep(0.5)
            assert "next attempt" in live.connections[0].state
            with router(port):
                await known(7)  # the node, two publishers, four subscriptions
            with router(port):
                await known(7)
                await cancel(task)
                await known(0)
        finally:
            await cancel(task)

    asyncio.run(run())


def test_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    """Domain, topic, type and hash; a subscription takes every hash."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    topic = Topic("/rov/odometry", "nav_msgs/msg/Odometry")
    assert topic.published() == f"7/rov/odometry/nav_msgs::msg::dds_::Odometry_/{ODOMETRY}"
    assert topic.subscribed() == "7/rov/odometry/nav_msgs::msg::dds_::Odometry_/*"


def test_every_type_has_its_hash() -> None:
    """Of every source, port and the diagnostics; a key can be made of each."""
    types = {*ROS_TYPES.values(), ROS_TYPE} | {
        str(getattr(make, "ros_type", "")) for make in PORTS.values()
    } - {""}
    assert {name.replace("/msg/", "/") for name in types} == set(HASHES)
    assert all(len(Topic("/a", name).published().split("RIHS01_")[1]) == 64 for name in types)


@pytest.mark.parametrize("text", ["-1", "233", "x", "1.5"])
def test_a_domain_that_is_none(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(DataError, match=rf"ROS_DOMAIN_ID is '{text}', expected an integer from 0 to 232"):
        domain()


def test_attachment() -> None:
    """Number, time, and the publisher's 16 bytes behind their count, little-endian."""
    data = attachment(1, 2, bytes(range(16)))
    assert data == bytes([1, *[0] * 7, 2, *[0] * 7, 16, *range(16)])
