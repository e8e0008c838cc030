"""What makers' clients, autopilots and the host do at the doors of `bottomlock live`."""

from __future__ import annotations

import asyncio
import json
import os
import socket
import sys
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bottomlock.encoders.registry import format_named
from bottomlock.encoders.waterlinked_serial import SerialCommands
from bottomlock.errors import BottomlockError
from bottomlock.instruments.play import parse_address, sink_of
from bottomlock.live.config import LiveConfig, load_config
from bottomlock.live.engine import Engine
from bottomlock.live.loop import cancel
from bottomlock.live.readings import MavlinkReader
from bottomlock.live.replay import replay_log
from bottomlock.live.runner import Live, begin, host_clock
from tests.live.processes import Instruments, free_port
from tests.live.world import World, config

pytest.importorskip("pymavlink", reason="needs pymavlink (extra mavlink)")
pytest.importorskip("serial_asyncio_fast", reason="needs pyserial-asyncio-fast (extra live)")
LIMIT_S = 20.0


def made(settings: LiveConfig) -> Live:
    return Live(settings, Engine(settings), say=lambda _: None)


async def run_until(live: Live, condition: Callable[[], bool]) -> None:
    """Runs until a condition holds."""
    task = asyncio.create_task(live.run())
    async with asyncio.timeout(LIMIT_S):
        while not condition():  # noqa: ASYNC110 - what is waited for has no event
            await asyncio.sleep(0.01)
    await cancel(task)


def test_an_autopilot_that_sends_to_who_speaks_first() -> None:
    """One UDP socket for source and port: a heartbeat, then its readings, and the estimates come from there."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as px4:
        px4.bind(("127.0.0.1", 0))
        px4.setblocking(False)
        place = f"udpout:127.0.0.1:{px4.getsockname()[1]}"
        change = ('"imu-csv"', '"mavlink"')
        live = made(config("navigation", imu=place, to=place, change=change))
        heard: set[tuple[str, Any]] = set()
        link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)

        def answered() -> bool:
            try:
                data, sender = px4.recvfrom(4096)
            except BlockingIOError:
                return False
            heard.update((one.get_type(), sender) for one in dialect.MAVLink(None).parse_buffer(data) or [])
            px4.sendto(dialect.MAVLink_highres_imu_message(5, *[0.0] * 13, 63).pack(link), sender)
            live.sinks[0].write(dialect.MAVLink_system_time_message(1, 1).pack(link))
            return live.engine.sources[1].reader.records > 0 and len(heard) == 2

        asyncio.run(run_until(live, answered))
    assert {kind for kind, _ in heard} == {"HEARTBEAT", "SYSTEM_TIME"}
    assert len({sender for _, sender in heard}) == 1


def test_datagrams_of_two_hosts_are_not_mixed() -> None:
    """The first gives readings; the other's are counted, and what its record would begin is not read."""
    port = free_port(socket.SOCK_DGRAM)
    told: list[str] = []
    settings = config(dvl=f"udpin:127.0.0.1:{port}")
    live = Live(settings, Engine(settings), say=told.append)
    reports = [data for _, _, data in World(4.0).arrivals()]
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second,
    ):
        second.bind(("127.0.0.2", 0))

        def mixed() -> bool:
            if live.sources[0].state == "listening" and reports:
                first.sendto(reports.pop(0), ("127.0.0.1", port))
                if live.engine.sources[0].used:
                    second.sendto(b'{"type":"velocity"', ("127.0.0.1", port))
            return live.sources[0].not_read >= 3 and live.engine.sources[0].used >= 5

        asyncio.run(run_until(live, mixed))
    assert dict(live.engine.sources[0].reader.skipped) == {}
    assert sum("a second host" in line for line in told) == 1


def test_nobody_who_receives_is_shown() -> None:
    """A datagram that is refused: the target says so."""
    live = made(config(to=f"udpout:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"))

    def refused() -> bool:
        live.sinks[0].write(b"nobody")
        return "nobody receives" in live.sinks[0].state

    asyncio.run(run_until(live, refused))


def test_a_target_that_nothing_can_open_ends_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would be silent for ever: a library that is missing, a folder that is not there."""
    monkeypatch.setitem(sys.modules, "serial_asyncio_fast", None)
    targets = {
        f"serial:{tmp_path}/line:9600": r"serial lines need pyserial-asyncio-fast",
        f"file:{tmp_path}/none/out": r"none/out: cannot be written \(No such file or directory\)",
    }
    for to, words in targets.items():
        with pytest.raises(BottomlockError, match=words):
            asyncio.run(asyncio.wait_for(made(config(to=to)).run(), LIMIT_S))


def test_a_serial_line_is_opened_once() -> None:
    """As source and as port: every line is read, and what is sent stands on the same line."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    place = f"serial:{os.ttyname(theirs)}:115200"
    live = made(config("navigation", imu=place, to=place))
    lines = [data for _, source, data in World(1.0).arrivals(imu=True) if source == 1]
    found = bytearray()
    os.set_blocking(ours, False)

    def all_read() -> bool:
        if "connected" in live.sources[1].state and lines:
            os.write(ours, lines.pop(0))
        live.sinks[0].write(b"sent")
        try:
            found.extend(os.read(ours, 4096))
        except BlockingIOError:
            return False
        # A stream may begin within a line: the first is not read.
        return live.engine.sources[1].reader.records == 99

    live.sources[1]._silence_s = 60.0
    asyncio.run(run_until(live, all_read))
    assert found.startswith(b"sent")
    for one in (ours, theirs):
        os.close(one)


GOOD = ("calibrate_gyro", "reset_dead_reckoning", "set_config", "get_config")


@pytest.mark.parametrize("served", ["live", "simulate-dvl"])
def test_the_makers_clients_configure(served: str) -> None:
    """Their requests stand one behind the other without an end of line; each has its answer, in order."""
    requests: list[dict[str, Any]] = [{"command": name} for name in GOOD]
    requests[2]["parameters"] = {"speed_of_sound": 1480, "range_mode": "2<=3"}
    requests += [
        {"command": "trigger_ping"},
        {"command": "set_config", "parameters": {"mounting_rotation_offset": 90}},
    ]

    async def asked() -> list[dict[str, Any]]:
        number = free_port(socket.SOCK_STREAM)
        commands = format_named("waterlinked-json").commands
        assert commands is not None
        if served == "live":
            change = ('port = "probe"', 'port = "waterlinked_json"')
            live = made(config(to=f"tcpin:127.0.0.1:{number}", change=change))
            task = asyncio.create_task(live.run())
            while live.sinks[0].state != "0 clients":  # noqa: ASYNC110 - what is waited for has no event
                await asyncio.sleep(0.01)
        else:
            sink = sink_of(parse_address(f"tcpin:{number}", "--dvl"), commands().client)
            task = asyncio.create_task(sink.run())
            while sink.state != "0 clients":  # noqa: ASYNC110
                await asyncio.sleep(0.01)
        reader, writer = await asyncio.open_connection("127.0.0.1", number)
        data = b"".join(json.dumps(one).encode() for one in requests) + b"nonsense\n"
        for at in range(0, len(data), 50):
            writer.write(data[at : at + 50])
            await writer.drain()
        async with asyncio.timeout(LIMIT_S):
            lines = [json.loads(await reader.readline()) for _ in range(len(requests) + 1)]
        writer.close()
        await cancel(task)
        return lines

    answers = asyncio.run(asked())
    assert [one["response_to"] for one in answers[:-1]] == [one["command"] for one in requests]
    assert [one["success"] for one in answers] == [True] * 4 + [False] * 3
    assert all(one["type"] == "response" and bool(one["error_message"]) != one["success"] for one in answers)
    assert (answers[3]["result"]["speed_of_sound"], answers[3]["result"]["range_mode"]) == (1480, "2<=3")


def test_commands_of_the_serial_line() -> None:
    answers = SerialCommands().client()
    told = answers(b"wcs,1450,,,y,,\nwcc*c9\r\nwcr\nwcx\nwcs,no,,,\nwcz\nwcr*00\nwc")
    assert [line.partition(b"*")[0] for line in told.splitlines()] == [
        b"wra", b"wr!", b"wra", b"wrn", b"wr?", b"wr?", b"wr!",
    ]  # fmt: skip
    assert answers(b"c\n").startswith(b"wrc,1450.0,0.0,y,y,auto,y*")


def test_two_vehicles_are_not_mixed() -> None:
    """Those of the first reading, or of the section; the other is counted by its system."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    def imu(system: int, component: int = 1) -> bytes:
        link = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        return bytes(dialect.MAVLink_highres_imu_message(5, *[0.0] * 13, 63).pack(link))

    for reader, kept in ((MavlinkReader(None, 9.8), 7), (MavlinkReader(None, 9.8, system=8), 8)):
        found = [len(reader.feed(imu(system) + imu(system, 2))) for system in (7, 8, 7)]
        assert found == [system == kept for system in (7, 8, 7)]
        assert any(f"of system {15 - kept}, component 1" in why for why in reader.skipped)
    # Nobody's number is one, too.
    reader = MavlinkReader(None, 9.8)
    assert [len(reader.feed(imu(*sender))) for sender in ((0, 0), (7, 1), (0, 1), (0, 0))] == [1, 0, 0, 1]


@pytest.mark.parametrize("known", [True, False])
def test_a_pause_of_the_host_is_no_fault_of_a_sensor(known: bool) -> None:
    """What came meanwhile is taken at its times; without knowing of the pause it would be a silence, and late."""
    engine, begin_ns, pause_ns = Engine(config("navigation")), 0, 400_000_000
    seen = set()
    for arrival_ns, source, data in World(6.0).arrivals(imu=True):
        begin_ns = begin_ns or arrival_ns + 4_000_000_000
        waits = begin_ns <= arrival_ns < begin_ns + pause_ns
        now_ns = begin_ns + pause_ns if waits else arrival_ns
        if waits and known and engine.now_ns < now_ns:
            engine.paused(now_ns - engine.now_ns, now_ns)
        engine.arrive(source, now_ns, data)
        if arrival_ns > begin_ns:
            seen.add(engine.state)
    assert seen == {"OK"} if known else "UNSAFE" in seen
    assert bool(engine.sources[1].refused) != known


def test_a_pause_is_seen_and_played_again(tmp_path: Path) -> None:
    """A loop that is held for 0.3 s: no state for it, and the raw log gives the same bits."""
    said: list[str] = []
    with Instruments(30.0) as instruments:
        instruments.write_config(tmp_path / "live.toml", free_port(socket.SOCK_DGRAM))
        settings = load_config(tmp_path / "live.toml")
        clock = host_clock()
        engine, log = begin(settings, b"", say=said.append, clock=clock, logged=True)
        live = Live(settings, engine, say=said.append, log=log, clock=clock)

        async def held() -> None:
            task = asyncio.create_task(live.run())
            async with asyncio.timeout(LIMIT_S):
                while engine.state != "OK":  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            said.clear()
            for _ in range(3):
                await asyncio.sleep(0.3)
                time.sleep(0.3)  # noqa: ASYNC251 - the pause
            await asyncio.sleep(0.3)
            await cancel(task)

        asyncio.run(held())
    assert not [words for words in said if words.startswith("state ")], said
    assert log is not None
    assert replay_log(settings, log.path).text().endswith("the same bits")
