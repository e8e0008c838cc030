"""Many clients, short connections and bytes that are nothing: bounded, and the true sender is still heard."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest

from bottomlock.live.device import MOST_WAITING, Device
from bottomlock.live.health import status
from bottomlock.live.loop import cancel
from bottomlock.live.transports import SECOND, open_source
from bottomlock.ports.address import source_address
from tests.live.test_health import ask, flown, served


def listened(
    use: Callable[[int, Device], Any], on_data: Callable[[bytes], bool]
) -> tuple[Any, list[str], int]:
    """What a client makes of a source that listens, what the source said, and how often it was connected."""
    said: list[str] = []
    connected: list[None] = []

    async def both() -> Any:  # noqa: ANN401
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        source = open_source(
            source_address(f"tcpin:127.0.0.1:{port}"),
            said.append,
            on_data=on_data,
            on_connected=lambda: connected.append(None),
            silence_s=60.0,
        )
        task = asyncio.create_task(source.run())
        async with asyncio.timeout(30.0):
            while source.state != "0 clients":  # noqa: ASYNC110 - what is waited for has no event
                await asyncio.sleep(0.005)
            result = await use(port, source)
        await cancel(task)
        return result

    return asyncio.run(both()), said, len(connected)


def test_a_listening_source_holds_one_client() -> None:
    """Of thirty that stay silent each is sent away for the next."""

    async def use(port: int, __: Device) -> None:
        clients = [await asyncio.open_connection("127.0.0.1", port) for _ in range(30)]
        await asyncio.gather(*(reader.read(1) for reader, _ in clients[:-1]), return_exceptions=True)
        last, _ = clients[-1]
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(last.read(1), 0.1)
        for _, writer in clients:
            writer.close()

    _, said, connected = listened(use, lambda _: False)
    assert (said, connected) == ([], 30)


def test_of_a_flood_the_last_pieces_are_taken() -> None:
    """What comes too fast waits in bounds; the oldest are dropped and counted, and others have turns."""
    size = 4 * MOST_WAITING * 1024
    found: list[bytes] = []

    def slow(data: bytes) -> bool:
        found.append(data)
        time.sleep(0.001)
        return False

    async def use(port: int, source: Device) -> tuple[int, int]:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(bytes(size) + b"end")
        turns = 0
        while not (found and found[-1].endswith(b"end")):
            await asyncio.sleep(0)
            turns += 1
        writer.close()
        return source.not_read, turns

    dropped, turns = listened(use, slow)[0]
    assert turns >= len(found) >= MOST_WAITING
    assert dropped > 0
    assert size - dropped * 1024 <= len(b"".join(found)) < size


def test_followers_do_not_take_the_whole_page() -> None:
    """Sixteen follow the events; the next is told, and the page still answers."""
    shown = status(flown())
    request = b"GET /events HTTP/1.1\r\n\r\n"

    async def use(port: int) -> tuple[bytes, bytes]:
        followers = []
        for _ in range(16):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(request)
            await reader.readuntil(b"\n\n")
            followers.append(writer)
        answers = await ask(port, request), await ask(port, b"GET /health HTTP/1.1\r\n\r\n")
        for writer in followers:
            writer.close()
        return answers

    refused, answered = served(lambda: shown, use)
    assert b"503" in refused.split(b"\r\n")[0]
    assert b"200 OK" in answered


@pytest.mark.parametrize(
    ("host", "code"),
    [
        (b"", 200),
        (b"host: [::1]:8770\r\n", 200),
        (b"Host: LOCALHOST.:1\r\n", 200),
        (b"Host: rov.local:8770\r\n", 200),
        (b"Host: evil.example\r\n", 421),
        (b"Host: 127.0.0.1.evil.example:8770\r\n", 421),
        (b"Host: localhost\r\nHost: evil.example\r\n", 421),
        (b"Host:\r\n", 421),
    ],
)
def test_the_page_is_asked_under_its_own_name(host: bytes, code: int) -> None:
    """An address, localhost or a name of the configuration; another name was pointed here by somebody else."""
    shown = status(flown())

    async def use(port: int) -> set[int]:
        asked = (b"GET %s HTTP/1.1\r\n%s\r\n" % (path, host) for path in (b"/", b"/health"))
        return {int((await ask(port, one)).split(b" ", 2)[1]) for one in asked}

    assert served(lambda: shown, use, "rov.local") == {code}


def test_the_client_that_gives_readings_is_heard() -> None:
    """A second one is sent away, and read once the first has gone."""
    found: list[bytes] = []

    def take(data: bytes) -> bool:
        found.append(data)
        return data.startswith(b"reading")

    async def use(port: int, source: Device) -> int:
        _, first = await asyncio.open_connection("127.0.0.1", port)
        first.write(b"reading")
        while not found:  # noqa: ASYNC110
            await asyncio.sleep(0.005)
        refused, writer = await asyncio.open_connection("127.0.0.1", port)
        assert await refused.read(1) == b""
        writer.close()
        first.close()
        await asyncio.sleep(0.05)
        _, second = await asyncio.open_connection("127.0.0.1", port)
        second.write(b"reading of the second")
        while len(found) < 2:  # noqa: ASYNC110
            await asyncio.sleep(0.005)
        second.close()
        return source.not_read

    dropped, said, connected = listened(use, take)
    assert found == [b"reading", b"reading of the second"]
    assert (dropped, connected) == (1, 2)
    assert SECOND in said
