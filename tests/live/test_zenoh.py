"""Messages over zenoh on loopback; skipped where eclipse-zenoh is not installed."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import sys
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from bottomlock.errors import DataError
from bottomlock.live import zenoh_session
from bottomlock.live.address import sink_address, source_address
from bottomlock.live.connections import cancel
from bottomlock.live.engine import Engine
from bottomlock.live.runner import Live
from bottomlock.live.sink import Sink
from bottomlock.live.sinks import open_sink
from bottomlock.live.zenoh_source import MOST_WAITING, receive
from tests.live.processes import free_port
from tests.live.world import World, config


@contextlib.contextmanager
def listening(port: int, key: str) -> Iterator[list[tuple[bytes, str]]]:
    """What a peer at this port hears under a key: payload and encoding."""
    zenoh = pytest.importorskip("zenoh", reason="needs eclipse-zenoh (extra zenoh)")
    settings = zenoh.Config()
    settings.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
    settings.insert_json5("scouting/multicast/enabled", "false")
    heard: list[tuple[bytes, str]] = []

    def take(sample: Any) -> None:  # noqa: ANN401 - untyped library
        heard.append((sample.payload.to_bytes(), str(sample.encoding)))

    session = zenoh.open(settings)
    try:
        session.declare_subscriber(key, take)
        yield heard
    finally:
        session.close()


async def until(heard: list[tuple[bytes, str]], number: int) -> None:
    """Waits for so many samples."""
    async with asyncio.timeout(20.0):
        while len(heard) < number:  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.01)


def test_ros_messages_over_zenoh() -> None:
    """A ROS port of mode velocity: the very CDR that the port made, under its key."""
    pytest.importorskip("zenoh", reason="needs eclipse-zenoh (extra zenoh)")
    port = free_port(socket.SOCK_STREAM)
    settings = config(to=f"zenoh:rt/dvl/velocity@tcp/127.0.0.1:{port}")
    settings = settings.model_copy(
        update={"port": (settings.port[0].model_copy(update={"port": "ros_velocity"}),)}
    )
    sent: list[bytes] = []

    async def run() -> None:
        live = Live(settings, Engine(settings), say=lambda _: None, clock=time.monotonic_ns)
        sink = live.sinks[0]
        task = asyncio.create_task(sink.run())
        with listening(port, "rt/dvl/*") as heard:
            async with asyncio.timeout(20.0):
                while sink.state != "publishing":  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            # The publisher's first samples may come before the subscription is known to it.
            await asyncio.sleep(0.5)
            for arrival_ns, place, data in World(1.0).arrivals():
                for message in live.engine.arrive(place, arrival_ns, data):
                    sent.append(message.data)
                    sink.write(message.data)
            await until(heard, len(sent))
            assert heard == [(data, "application/cdr") for data in sent]
        await cancel(task)

    asyncio.run(run())
    assert len(sent) == 10


def test_an_absent_router_is_tried_again() -> None:
    """The state says so, in one line; messages meanwhile are counted as dropped."""
    pytest.importorskip("zenoh", reason="needs eclipse-zenoh (extra zenoh)")

    async def run() -> str:
        sink = open_sink(sink_address("zenoh:a/b@tcp/127.0.0.1:1"), lambda _: None)
        task = asyncio.create_task(sink.run())
        async with asyncio.timeout(20.0):
            while "next attempt" not in sink.state:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
        sink.write(b"x")
        await cancel(task)
        assert sink.dropped == 1
        return sink.state

    assert asyncio.run(run()).startswith("cannot be opened: Unable to connect to any of ")


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """As for the other extras."""
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(
        DataError, match=r"`pip install '\.\[zenoh\]'` in the folder of bottomlock's sources$"
    ):
        open_sink(sink_address("zenoh:a/b"), lambda _: None)


@pytest.mark.parametrize("text", ["zenoh:", "zenoh:/a", "zenoh:a//b", "zenoh:a/*", "zenoh:a@"])
def test_keys_that_are_none(text: str) -> None:
    """One line with what was expected."""
    with pytest.raises(ValueError, match=r"expected zenoh:KEY or zenoh:KEY@tcp/HOST:PORT$"):
        sink_address(text)


def test_samples_as_a_source() -> None:
    """Reports of a DVL under a key, cut anywhere: the pings that the same bytes give by a socket."""
    zenoh = pytest.importorskip("zenoh", reason="needs eclipse-zenoh (extra zenoh)")
    port = free_port(socket.SOCK_STREAM)
    settings = config(dvl=f"zenoh:rov/dvl@tcp/127.0.0.1:{port}")
    reports = b"".join(data for _, _, data in World(1.0).arrivals())

    async def run() -> int:
        live = Live(settings, Engine(settings), say=lambda _: None, sinks=[Sink()], clock=time.monotonic_ns)
        publisher_settings = zenoh.Config()
        publisher_settings.insert_json5("listen/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
        publisher_settings.insert_json5("scouting/multicast/enabled", "false")
        session = zenoh.open(publisher_settings)
        task = asyncio.create_task(live.connections[0].run())
        try:
            async with asyncio.timeout(20.0):
                while live.connections[0].state != "listening":  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
                await asyncio.sleep(0.5)
                for at in range(0, len(reports), 700):
                    session.put("rov/dvl", reports[at : at + 700])
                while live.engine.sources[0].reader.records < 10:  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
        finally:
            await cancel(task)
            session.close()
        return live.engine.sources[0].reader.framer.dropped

    assert asyncio.run(run()) == 0


def test_a_flood_of_samples_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the loop does something else at most so many wait; the others are dropped and counted."""
    callbacks: list[Callable[[Any], None]] = []
    held = SimpleNamespace(undeclare=lambda: None)

    def declare_subscriber(_: str, callback: Callable[[Any], None]) -> Any:  # noqa: ANN401
        callbacks.append(callback)
        return held

    session = SimpleNamespace(declare_subscriber=declare_subscriber)
    left: list[str] = []

    async def joined(_: str) -> Any:  # noqa: ANN401
        return SimpleNamespace(zenoh=session)

    monkeypatch.setattr(zenoh_session, "library", lambda: None)
    monkeypatch.setattr(zenoh_session, "joined", joined)
    monkeypatch.setattr(zenoh_session, "leave", left.append)
    taken: list[bytes] = []
    dropped: list[None] = []

    async def run() -> None:
        task = asyncio.create_task(
            receive(
                source_address("zenoh:a/b"),
                "",
                on_data=taken.append,
                on_opened=lambda: None,
                on_dropped=lambda: dropped.append(None),
            )
        )
        while not callbacks:  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0)
        sample = SimpleNamespace(payload=SimpleNamespace(to_bytes=lambda: b"x"))
        for _ in range(MOST_WAITING + 7):
            callbacks[0](sample)
        await asyncio.sleep(0.01)
        callbacks[0](sample)
        await asyncio.sleep(0.01)
        await cancel(task)

    asyncio.run(run())
    assert (len(taken), len(dropped), left) == (MOST_WAITING + 1, 7, [""])
