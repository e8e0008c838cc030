"""The health page: state, beams, sources and ports as JSON, Prometheus text and events; odd clients do no harm."""

from __future__ import annotations

import asyncio
import gc
import json
import re
import socket
import struct
from collections.abc import Awaitable, Callable
from importlib import resources
from typing import Any

from bottomlock.live.engine import Engine
from bottomlock.live.health import HealthServer, metrics, status
from bottomlock.live.runner import Live
from tests.live.world import World, config, fly


def flown(seconds: float = 2.0, lost: tuple[int, ...] = ()) -> Live:
    """A run that is over, as the page sees it, in a loop of its own."""
    settings = config()
    engine = Engine(settings)
    fly(engine, World(seconds, lambda t: lost if t > 1.0 else ()).arrivals())
    now = engine.now_ns + 100_000_000
    return Live(settings, engine, say=lambda _: None, send=lambda _: None, clock=lambda: now)


def test_status_is_json_in_si() -> None:
    """State and why, velocity with its sigma, beams, ages and counts; None for what is not known."""
    shown = json.loads(json.dumps(status(flown(lost=(1, 2))), allow_nan=False))
    assert shown["state"] == "PARTIAL"
    assert shown["why"] == "beams determine 2 of 3 directions"
    assert [beam["used"] for beam in shown["beams"]] == [True, False, False, True]
    assert shown["beams"][1]["velocity_mps"] is None
    assert sum(value is None for value in shown["velocity_mps"]) >= 2
    assert shown["sources"][0] | {"age_s": 0.1} == shown["sources"][0]
    assert shown["sources"][0]["taken"] == 20
    assert shown["ports"][0]["sent"] == 20


def test_metrics_are_prometheus_text() -> None:
    """Every line is a comment or a sample; each name has its help and type."""
    text = metrics(status(flown()))
    sample = re.compile(r'bottomlock_[a-z0-9_]+(\{([a-z]+="[^"\n]*",?)+\})? -?[0-9.e+-]+')
    for line in text.splitlines():
        assert line.startswith(("# HELP ", "# TYPE ")) or sample.fullmatch(line), line
    assert 'bottomlock_state{state="OK"} 1' in text
    assert 'bottomlock_source_taken_total{source="dvl"} 20' in text
    names = {re.split(r"[{ ]", line)[0] for line in text.splitlines() if not line.startswith("#")}
    assert all(f"# TYPE {name} " in text for name in names)


def served(show: Callable[[], dict[str, Any]], use: Callable[[int], Awaitable[Any]], *names: str) -> Any:  # noqa: ANN401
    """What a client gets from a server of these names on a free port."""

    async def both() -> Any:  # noqa: ANN401
        server = HealthServer(show, "127.0.0.1", 0, names=names)
        opened = asyncio.Event()
        task = asyncio.create_task(server.run(opened.set))
        await asyncio.wait_for(opened.wait(), 5.0)
        try:
            return await use(int(server.url.rstrip("/").rsplit(":", 1)[1]))
        finally:
            task.cancel()

    return asyncio.run(both())


async def ask(port: int, request: bytes, size: int = -1) -> bytes:
    """The answer to a request, up to some bytes."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(request)
    try:
        return await asyncio.wait_for(reader.read() if size < 0 else reader.readexactly(size), 8.0)
    finally:
        writer.close()


def test_paths_and_codes() -> None:
    """Page, health, metrics; 503 while nothing may be used; what is not there and what is not GET is said."""
    shown = status(flown())

    async def use(port: int) -> list[bytes]:
        paths = [b"/", b"/health", b"/metrics", b"/nothing"]
        answers = [await ask(port, b"GET " + path + b" HTTP/1.1\r\n\r\n") for path in paths]
        answers.append(await ask(port, b"POST /health HTTP/1.1\r\n\r\n"))
        shown["state"] = "UNSAFE"
        answers.append(await ask(port, b"GET /health HTTP/1.1\r\n\r\n"))
        return answers

    answers = served(lambda: shown, use)
    codes = [int(answer.split(b" ", 2)[1]) for answer in answers]
    assert codes == [200, 200, 200, 404, 405, 503]
    assert json.loads(answers[1].split(b"\r\n\r\n", 1)[1]) == shown | {"state": "OK"}
    assert b"default-src 'none'" in answers[0]


def test_events_follow_the_state() -> None:
    """One event each quarter of a second, with the whole status."""
    shown = status(flown())

    async def use(port: int) -> list[str]:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"GET /events HTTP/1.1\r\n\r\n")
        await reader.readuntil(b"\r\n\r\n")
        found = []
        for state in ("OK", "COASTING"):
            event = await asyncio.wait_for(reader.readuntil(b"\n\n"), 5.0)
            found.append(json.loads(event.removeprefix(b"data: "))["state"])
            shown["state"] = "COASTING" if state == "OK" else state
        writer.close()
        return found

    assert served(lambda: shown, use) == ["OK", "COASTING"]


def test_odd_clients_do_no_harm() -> None:
    """Garbage, a request too long, one that hangs up or is gone before it is accepted: the next is answered."""
    faults: list[str] = []

    async def use(port: int) -> bytes:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: faults.append(context["message"]))
        with socket.create_connection(("127.0.0.1", port)) as gone:
            gone.sendall(b"GET / HTTP/1.1\r\n\r\n")
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        await ask(port, b"\x00\xff\r\n\r\n")
        _, hanging = await asyncio.open_connection("127.0.0.1", port)
        hanging.write(b"GET / HT")
        hanging.close()
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"GET /" + b"x" * 100_000)
        assert await asyncio.wait_for(reader.read(), 8.0) == b""
        writer.close()
        return await ask(port, b"GET /metrics HTTP/1.1\r\n\r\n")

    assert b"200 OK" in served(lambda: status(flown()), use)
    gc.collect()
    assert not faults


def test_the_page_uses_no_network() -> None:
    """One file: no address of another host, and every element that its script fills is there."""
    page = (resources.files("bottomlock.live") / "page.html").read_text(encoding="utf-8")
    assert "://" not in page
    assert not re.search(r"(src|href)=", page)
    used = set(re.findall(r'by\("([a-z]+)"\)|rows\("([a-z]+)"', page))
    ids = set(re.findall(r'id="([a-z]+)"', page))
    assert {a or b for a, b in used} <= ids
