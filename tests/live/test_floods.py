"""Many clients, short connections and bytes that are nothing: bounded, and the true sender is still heard."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest

from bottomlock.live.address import source_address
from bottomlock.live.connections import MOST_CLIENTS, SECOND, SLOWED, Allowance, Connection, cancel
from bottomlock.live.health import HealthServer, status
from tests.live.test_health import ask, flown, served


def listened(
    use: Callable[[int, Connection], Any], on_data: Callable[[bytes], bool]
) -> tuple[Any, list[str], int]:
    """What a client makes of a source that listens, what the source said, and how often it was connected."""
    said: list[str] = []
    connected: list[None] = []

    async def both() -> Any:  # noqa: ANN401
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        connection = Connection(
            source_address(f"tcpin:127.0.0.1:{port}"),
            on_data=on_data,
            on_connected=lambda: connected.append(None),
            on_state=said.append,
            silence_s=60.0,
        )
        task = asyncio.create_task(connection.run())
        async with asyncio.timeout(30.0):
            while "listening" not in said:  # noqa: ASYNC110 - what is waited for has no event
                await asyncio.sleep(0.005)
            result = await use(port, connection)
        await cancel(task)
        return result

    return asyncio.run(both()), said, len(connected)


def test_a_listening_source_holds_few_clients() -> None:
    """Of thirty that stay silent, the ones that have been silent longest are sent away for the next."""

    async def use(port: int, __: Connection) -> int:
        clients = [await asyncio.open_connection("127.0.0.1", port) for _ in range(30)]
        reads = [asyncio.ensure_future(reader.read(1)) for reader, _ in clients]
        while sum(one.done() for one in reads) < 30 - MOST_CLIENTS:  # noqa: ASYNC110
            await asyncio.sleep(0.005)
        await asyncio.sleep(0.1)
        ended = [one.done() for one in reads]
        for one in reads:
            one.cancel()
        await asyncio.gather(*reads, return_exceptions=True)
        for _, writer in clients:
            writer.close()
        assert ended == [True] * (30 - MOST_CLIENTS) + [False] * MOST_CLIENTS
        return sum(ended)

    assert listened(use, lambda _: False)[0] == 30 - MOST_CLIENTS


def test_bytes_that_are_nothing_wait_and_are_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes long and gives no reading is read with pauses, and the source says so."""
    # So that a machine that is busy with other work uses the share up as well.
    monkeypatch.setattr(Allowance, "FRUITLESS", 40.0)
    found = bytearray()

    def slow(data: bytes) -> bool:
        found.extend(data)
        until = time.thread_time() + 0.002
        while time.thread_time() < until:
            pass
        return False

    async def use(port: int, __: Connection) -> None:
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(bytes(12 * 1024))
        while len(found) < 12 * 1024:  # noqa: ASYNC110
            await asyncio.sleep(0.01)
        writer.close()

    assert SLOWED in listened(use, slow)[1]
    assert bytes(found) == bytes(12 * 1024)


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

    async def use() -> bytes:
        server = HealthServer(lambda: shown, "127.0.0.1", 0, names=["rov.local"])
        task = asyncio.create_task(server.run())
        await server.opened.wait()
        port = int(server.url.rstrip("/").rsplit(":", 1)[1])
        answers = [
            await ask(port, b"GET %s HTTP/1.1\r\n%s\r\n" % (path, host)) for path in (b"/", b"/health")
        ]
        await cancel(task)
        assert len({answer.split(b" ", 2)[1] for answer in answers}) == 1
        return answers[0]

    assert int(asyncio.run(use()).split(b" ", 2)[1]) == code


def test_the_client_that_gives_readings_is_heard() -> None:
    """A second one that sends at the same time is not read, and is once the first has gone."""
    found: list[bytes] = []

    def take(data: bytes) -> bool:
        found.append(data)
        return data.startswith(b"reading")

    async def use(port: int, connection: Connection) -> int:
        _, first = await asyncio.open_connection("127.0.0.1", port)
        first.write(b"reading")
        while not found:  # noqa: ASYNC110
            await asyncio.sleep(0.005)
        _, second = await asyncio.open_connection("127.0.0.1", port)
        second.write(b"garbage")
        while not connection.dropped:  # noqa: ASYNC110
            await asyncio.sleep(0.005)
        dropped = connection.dropped
        first.close()
        await asyncio.sleep(0.05)
        second.write(b"reading of the second")
        while len(found) < 2:  # noqa: ASYNC110
            await asyncio.sleep(0.005)
        second.close()
        return dropped

    dropped, said, connected = listened(use, take)
    assert found == [b"reading", b"reading of the second"]
    assert (dropped, connected) == (1, 2)
    assert SECOND in said
