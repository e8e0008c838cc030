"""A TCP client that reads more slowly than it is sent gets the newest estimates: older ones are dropped and counted."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import socket
import struct
import termios
from collections.abc import Iterator
from typing import Any

import pytest

from bottomlock.live.device import MOST_ANSWERED_BYTES, WAITING_S, Device
from bottomlock.live.loop import cancel
from bottomlock.live.transports import FULL, MOST_RECEIVERS, open_sink
from bottomlock.ports.address import sink_address

SIZE = 800
"""Bytes of a report, about those of Water Linked's JSON."""
RECEIVED_BYTES = 16_384
SENT, PERIOD_S = 200, 0.005
SAID: list[str] = []


def report(number: int) -> bytes:
    return f"{number:9d}\n".rjust(SIZE).encode()


def numbers(data: bytes) -> Iterator[int]:
    assert len(data) % SIZE == 0
    return (int(data[at : at + SIZE]) for at in range(0, len(data), SIZE))


async def connected(kind: str, **settings: Any) -> tuple[Device, asyncio.Task[None], socket.socket]:  # noqa: ANN401
    """A port that listens or connects, and its client with a small buffer of its own."""
    other = socket.socket()
    other.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVED_BYTES)
    with socket.create_server(("127.0.0.1", 0)) as free:
        place = free.getsockname()
    if kind == "tcp":
        other.bind(place)
        other.listen()
    SAID.clear()
    sink = open_sink(sink_address(f"{kind}:127.0.0.1:{place[1]}"), SAID.append, **settings)
    task = asyncio.create_task(sink.run())
    while sink.state == "not opened yet":  # noqa: ASYNC110 - what is waited for has no event
        await asyncio.sleep(0.005)
    if kind == "tcp":
        client, _ = other.accept()
        other.close()
    else:
        other.connect(place)
        client = other
        while sink.state != "1 clients":  # noqa: ASYNC110
            await asyncio.sleep(0.005)
    client.setblocking(False)
    return sink, task, client


@pytest.mark.parametrize("kind", ["tcpin", "tcp"])
def test_of_a_client_that_stops_reading_a_fifth_of_a_second_waits_here(kind: str) -> None:
    """What it finds later is its own buffer, that and the newest estimate; the rest is counted, and the next comes."""

    async def flood() -> None:
        sink, task, client = await connected(kind)
        for number in range(SENT):
            sink.write(report(number))
            await asyncio.sleep(PERIOD_S)
        (own,) = struct.unpack("i", fcntl.ioctl(client, termios.FIONREAD, bytes(4)))
        held = bytearray()
        for _ in range(20):
            with contextlib.suppress(BlockingIOError):
                held += client.recv(1 << 20)
            await asyncio.sleep(0.005)
        *kept, newest = numbers(bytes(held))
        assert kept == list(range(len(kept)))
        assert newest == SENT - 1
        assert (sink.written[0], sink.dropped[0]) == (len(kept) + 1, SENT - len(kept) - 1)
        assert sum("reads too slowly" in words for words in SAID) == 1
        assert len(held) - own <= (WAITING_S / PERIOD_S + 3) * SIZE
        sink.write(report(SENT))
        await asyncio.sleep(0.1)
        assert list(numbers(client.recv(1 << 20))) == [SENT]
        assert sink.written[0] + sink.dropped[0] == SENT + 1
        client.close()
        await cancel(task)

    asyncio.run(flood())


def test_a_port_says_that_it_is_full() -> None:
    """It has no readings of which one client is the source."""

    async def fill() -> None:
        sink, task, client = await connected("tcpin")
        place = client.getpeername()
        others = [await asyncio.open_connection(*place) for _ in range(MOST_RECEIVERS)]
        assert await asyncio.wait_for(others[-1][0].read(), 10.0) == b""
        assert (SAID, sink.not_read) == ([FULL], 1)
        for _, writer in others:
            writer.close()
        client.close()
        await cancel(task)

    asyncio.run(fill())


def test_a_client_that_asks_and_does_not_read_is_not_read() -> None:
    """No more answers wait for it than are allowed."""

    async def flood() -> int:
        sink, task, client = await connected("tcpin", answers=lambda: lambda data: data * 64)
        most = 0
        for _ in range(40):
            with contextlib.suppress(BlockingIOError):
                client.send(bytes(1 << 16))
            await asyncio.sleep(PERIOD_S)
            most = max(most, *(one.unwritten for one in sink.receivers))
        client.close()
        await cancel(task)
        return most

    piece = 64 * 1024
    assert MOST_ANSWERED_BYTES < asyncio.run(flood()) <= MOST_ANSWERED_BYTES + piece
