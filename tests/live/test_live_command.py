"""The whole command on loopback: a TCP server of DVL reports, an IMU by UDP, a UDP listener, the raw log."""

from __future__ import annotations

import asyncio
import struct
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bottomlock.live.engine import Engine, Message
from bottomlock.live.raw_log import RawLog, ReadLog
from bottomlock.live.replay import replay_log
from bottomlock.live.runner import Live
from tests.live.world import START_NS, Sent, World, config


def losses(t: float) -> tuple[int, ...]:
    """Two beams lost from 1.9 s to 2.4 s, all from 2.4 s to 3.2 s."""
    return (1, 2) if 1.9 <= t < 2.4 else (0, 1, 2, 3) if 2.4 <= t < 3.2 else ()


class Listener(asyncio.DatagramProtocol):
    """What an autopilot would hear."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []

    def datagram_received(self, data: bytes, addr: object) -> None:  # noqa: ARG002 - asyncio's
        """Keeps it."""
        self.heard.append(data)


async def play(
    world: World, writers: list[asyncio.StreamWriter], imu: asyncio.DatagramTransport | None
) -> None:
    """Sends a world's bytes at their times, in real time."""
    begin = time.monotonic_ns()
    for arrival_ns, source, data in world.arrivals(imu=imu is not None):
        wait_s = (arrival_ns - START_NS - (time.monotonic_ns() - begin)) * 1e-9
        if wait_s > 0.002:
            await asyncio.sleep(wait_s)
        if source == 1 and imu is not None:
            imu.sendto(data)
        elif writers and not writers[0].is_closing():
            writers[0].write(data)


async def whole_chain(tmp_path: Path) -> tuple[list[Sent], Path, list[str]]:
    """Runs everything in one loop: instruments, live, listener."""
    loop = asyncio.get_running_loop()
    listening, listener = await loop.create_datagram_endpoint(Listener, local_addr=("127.0.0.1", 0))
    clients: list[asyncio.StreamWriter] = []
    server = await asyncio.start_server(lambda _, w: clients.insert(0, w), "127.0.0.1", 0)
    free, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, local_addr=("127.0.0.1", 0))
    imu_port = free.get_extra_info("sockname")[1]
    free.close()
    await asyncio.sleep(0)
    settings = config(
        "navigation",
        dvl=f"tcp:127.0.0.1:{server.sockets[0].getsockname()[1]}",
        imu=f"udpin:127.0.0.1:{imu_port}",
        to=f"udpout:127.0.0.1:{listening.get_extra_info('sockname')[1]}",
    )
    log = RawLog(tmp_path, sources=["dvl", "imu"], ports=["probe"], start={"config.toml": b"x"})
    words: list[str] = []
    task = asyncio.create_task(Live(settings, Engine(settings), say=words.append, log=log).run())
    imu, _ = await loop.create_datagram_endpoint(
        asyncio.DatagramProtocol, remote_addr=("127.0.0.1", imu_port)
    )
    await asyncio.sleep(0.3)
    await play(World(4.5, losses), clients, imu)
    await asyncio.sleep(0.1)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    for one in (imu, listening):
        one.close()
    server.close()
    for client in clients:
        client.close()
    return [Sent.parse(data) for data in listener.heard], log.path, words


def test_from_the_dvls_line_to_the_listener(tmp_path: Path) -> None:
    """OK, PARTIAL, COASTING, OK at the listener, without a jump; the raw log gives the same bits again."""
    heard, log, words = asyncio.run(whole_chain(tmp_path))
    names = [sent.state for sent in heard]
    assert names[:1] + [b for a, b in pairwise(names) if a != b] == ["OK", "PARTIAL", "COASTING", "OK"]
    for before, after in pairwise(heard):
        assert (np.abs(after.velocity - before.velocity) < 3.0 * np.hypot(before.sd, after.sd)).all()
    assert "source dvl: connected" in words
    result = replay_log(config("navigation"), log)
    assert result.first_difference == ""
    assert result.sent == len(result.messages) == len(heard)
    assert result.text().endswith("the same bits")
    assert ReadLog(log).start == {"config.toml": b"x"}


def write_log(folder: Path, messages: int = 20) -> bytes:
    """A log of a short run in mode velocity."""
    engine = Engine(config())
    log = RawLog(folder, sources=["dvl"], ports=["probe"], start={})
    log.write("connected", 0, START_NS, b"")
    engine.connected(0, START_NS)
    for arrival_ns, source, data in World(messages / 10).arrivals():
        log.write("in", source, arrival_ns, data)
        for message in engine.arrive(source, arrival_ns, data):
            log.write("out", message.port, arrival_ns, message.data)
    log.flush()
    content = log.path.read_bytes()
    log.close()
    return content


def test_a_log_that_is_cut_off_is_read_up_to_there(tmp_path: Path) -> None:
    """As a kill leaves it: at any byte, and what is there gives the bits that were sent."""
    content = write_log(tmp_path)
    cut = tmp_path / "cut.mcap"
    whole = 0
    for size in (*range(2000, len(content), 977), len(content)):
        cut.write_bytes(content[:size])
        result = replay_log(config(), cut)
        assert result.first_difference == ""
        assert result.entries >= whole
        whole = result.entries
    assert whole == 21


def test_another_message_than_was_sent_is_seen(tmp_path: Path) -> None:
    """One bit of one message: the replay names it."""
    content = bytearray(write_log(tmp_path))
    at = content.index(b" OK 3 0 ")
    content[at + 8] ^= 1
    changed = tmp_path / "changed.mcap"
    changed.write_bytes(content)
    assert replay_log(config(), changed).first_difference.startswith("message 1 (port 0, at 1790000000")


def test_a_fault_of_ours_stops_the_sending_and_is_said() -> None:
    """The process goes on, in state UNSAFE, and shows the error."""
    settings = config()
    words: list[str] = []
    sent: list[Message] = []
    arrivals = list(World(1.0).arrivals())
    clock = iter([arrival for arrival, _, _ in arrivals])
    engine = Engine(settings)
    running = Live.__new__(Live)
    running.__dict__.update(
        config=settings, engine=engine, log=None, faults=0, _say=words.append, _send=sent.append,
        clock=lambda: next(clock), _state="INITIALISING",
    )  # fmt: skip
    for _, _, data in arrivals[:5]:
        running.arrive(0, data)
    assert len(sent) == 5
    engine.estimator.take = lambda *_: 1 / 0  # type: ignore[method-assign, assignment]
    for _, _, data in arrivals[5:]:
        running.arrive(0, data)
    assert len(sent) == 5
    assert engine.state == "UNSAFE"
    assert "ZeroDivisionError" in engine.machine.why
    assert any("nothing is sent any more" in word for word in words)


def test_a_log_says_where_it_ends(tmp_path: Path) -> None:
    """Closed, killed, damaged; of a damaged one nothing behind is played, and the command ends with an error."""
    killed = tmp_path / "killed.mcap"
    content = write_log(tmp_path)
    (closed,) = tmp_path.glob("2*.mcap")
    assert replay_log(config(), closed).end == ""
    killed.write_bytes(content[:-3])
    result = replay_log(config(), killed)
    assert (result.damaged, result.end.partition(" at byte")[0]) == (False, "cut off")
    assert "the same bits; cut off at byte" in result.text()
    at = content.index(b"\x05", len(content) // 2)
    while struct.unpack_from("<Q", content, at + 1)[0] > 5000:
        at = content.index(b"\x05", at + 1)
    killed.write_bytes(content[: at + 2] + bytes([content[at + 2] ^ 64]) + content[at + 3 :])
    result = replay_log(config(), killed)
    assert result.damaged
    assert result.end.startswith(f"damaged at byte {at} of {len(content)}: a record of ")
    assert 0 < result.entries < 21
