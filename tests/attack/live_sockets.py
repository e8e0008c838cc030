"""Live use under seeded faults, end to end through sockets: the cases of `live_faults` over TCP and UDP on loopback.

Usage: python -m tests.attack.live_sockets [--cases 1000] [--first 0] [--together 20]

Of each case the DVL is a TCP server that `live` connects to; the IMU sends datagrams, or is a server too; what `live`
sends is heard over UDP, or by a TCP client that reads; some have a browser on their health page. Several cases run
together on one event loop. Its clock goes on to the next timer as soon as no socket has anything to be read, so that
9 s pass as fast as they are computed, back-off and silences included. Besides what `live_faults` demands, every
message that was sent is heard, no task ends with an error, and afterwards no descriptor, task or object is left.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import ctypes
import gc
import os
import selectors
import socket
import time
import weakref
from collections import Counter
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bottomlock.live.connections import cancel
from bottomlock.live.engine import Engine
from bottomlock.live.health import EVENT_S, HealthServer, status
from bottomlock.live.runner import Live
from bottomlock.ports.estimate import SILENT
from tests.attack.live_faults import (
    LOSSES,
    SECONDS,
    SETTINGS,
    STEPS,
    Entry,
    Outcome,
    case_of,
    recorded,
    wrong_in,
)
from tests.live.processes import free_port
from tests.live.world import START_NS, Sent, config, probe_registered

MOST_DATAGRAM = 60_000
LEAD_S = 0.5
"""Time in which the connections are made before the run begins."""
GROWTH_BOUND_MB = 3.0
"""Of resident memory between the first tenth of the cases and the end: pages that are in use in part."""


class _Selector(selectors.DefaultSelector):
    """Does not wait for a timer: `now_s` goes on to it once no socket is ready."""

    now_s = 0.0

    def select(self, timeout: float | None = None) -> list[Any]:
        """The sockets that are ready; waits only where there is no timer at all."""
        events = super().select(0)
        if events:
            return events
        if timeout is None:
            return super().select(None)
        self.now_s += max(timeout, 0.0)
        return []


class Loop(asyncio.SelectorEventLoop):
    """An event loop whose time is that of its timers."""

    def __init__(self) -> None:
        self._timers = _Selector()
        super().__init__(self._timers)

    def time(self) -> float:
        """Seconds since the loop was made."""
        return self._timers.now_s


class _Hearing(asyncio.DatagramProtocol, asyncio.Protocol):
    """What an autopilot hears: lines of the probe."""

    def __init__(self) -> None:
        self.data = b""

    def datagram_received(self, data: bytes, addr: object) -> None:  # noqa: ARG002 - asyncio's
        self.data += data

    def data_received(self, data: bytes) -> None:
        self.data += data


class _Instrument(asyncio.Protocol):
    """The connection of a client to an instrument that is a TCP server."""

    def __init__(self, clients: set[asyncio.Transport]) -> None:
        self._clients = clients

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        sock = transport.get_extra_info("socket")
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clients.add(transport)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's
        self._clients.discard(self._transport)


@dataclass
class _Case:
    """One case on the running loop."""

    number: int
    states: set[str] = field(default_factory=set)
    words: list[str] = field(default_factory=list)
    wrong: str = ""
    hearing: _Hearing = field(default_factory=_Hearing)
    ports: list[int] = field(default_factory=list)
    closing: list[Callable[[], object]] = field(default_factory=list)
    tasks: list[asyncio.Task[Any]] = field(default_factory=list)

    async def run(self) -> tuple[Outcome, weakref.ref[Live]]:
        """Runs it; the outcome, and a reference that must be dead once all is closed."""
        case = case_of(self.number)
        write = [await self._server(), await self._imu()]
        live = await self._live(case.form)
        await asyncio.sleep(LEAD_S)
        await self._play(case.entries, write, live)
        await asyncio.sleep(0.05)
        for task in reversed(self.tasks):
            self._ended(task)
            await cancel(task)
        # What is still on its way.
        await asyncio.sleep(0.1)
        for close in self.closing:
            close()
        # The page looks for its reader before each event.
        await asyncio.sleep(2.0 * EVENT_S)
        return self._outcome(case.names, live), weakref.ref(live)

    def _spawn(self, work: Coroutine[Any, Any, Any]) -> None:
        self.tasks.append(asyncio.get_running_loop().create_task(work))

    def _ended(self, task: asyncio.Task[Any]) -> None:
        if task.done() and not task.cancelled() and task.exception() is not None:
            self.wrong = self.wrong or f"a task ended with {task.exception()!r}"

    async def _server(self) -> Callable[[bytes | None], None]:
        """An instrument that is a TCP server; None closes its connections."""
        clients: set[asyncio.Transport] = set()
        server = await asyncio.get_running_loop().create_server(lambda: _Instrument(clients), "127.0.0.1", 0)
        self.ports.append(server.sockets[0].getsockname()[1])

        def close() -> None:
            server.close()
            for client in list(clients):
                client.abort()

        self.closing.append(close)

        def write(data: bytes | None) -> None:
            for client in list(clients):
                if data is not None:
                    client.write(data)
                elif self.number % 2:
                    client.abort()
                else:
                    client.close()

        return write

    async def _imu(self) -> Callable[[bytes | None], None]:
        """The IMU: a server in every third case, else a sender of datagrams."""
        if self.number % 3 == 0:
            return await self._server()
        port = free_port(socket.SOCK_DGRAM)
        self.ports.append(port)
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            asyncio.DatagramProtocol, remote_addr=("127.0.0.1", port)
        )
        self.closing.append(transport.close)

        def write(data: bytes | None) -> None:
            for first in range(0, len(data or b""), MOST_DATAGRAM):
                transport.sendto((data or b"")[first : first + MOST_DATAGRAM])

        return write

    async def _live(self, form: str) -> Live:
        """`live` between the two, on the loop's clock."""
        loop = asyncio.get_running_loop()
        begin_s = loop.time() + LEAD_S
        kind = "tcp" if self.number % 3 == 0 else "udpin"
        if self.number % 5 == 0:
            to_port = free_port(socket.SOCK_STREAM)
            to = f"tcpin:127.0.0.1:{to_port}"
        else:
            heard, _ = await loop.create_datagram_endpoint(lambda: self.hearing, local_addr=("127.0.0.1", 0))
            self.closing.append(heard.close)
            to = f"udpout:127.0.0.1:{heard.get_extra_info('sockname')[1]}"
        settings = config(
            "navigation", extra=SETTINGS, format=form, to=to,
            dvl=f"tcp:127.0.0.1:{self.ports[0]}", imu=f"{kind}:127.0.0.1:{self.ports[1]}",
        )  # fmt: skip
        engine = Engine(settings)
        live = Live(
            settings, engine, say=self.words.append,
            clock=lambda: START_NS + round((loop.time() - begin_s) * 1e9),
        )  # fmt: skip
        self._watch(live)
        self._spawn(live.run())
        await asyncio.sleep(0)
        if to.startswith("tcpin"):
            await asyncio.sleep(0.1)
            client, _ = await loop.create_connection(lambda: self.hearing, "127.0.0.1", to_port)
            self.closing.append(client.abort)
        if self.number % 4 == 0:
            self._spawn(self._browser(live))
        return live

    def _watch(self, live: Live) -> None:
        """Looks at the state whenever a message is written."""
        engine, sink = live.engine, live.sinks[0]
        write = sink.write

        def watched(data: bytes) -> None:
            if engine.state in SILENT:
                self.wrong = self.wrong or f"sent in state {engine.state}"
            write(data)

        sink.write = watched  # type: ignore[method-assign]

    async def _browser(self, live: Live) -> None:
        """The health page, and someone who reads its events."""
        server = HealthServer(lambda: status(live), "127.0.0.1", 0)
        serving = asyncio.get_running_loop().create_task(server.run())
        try:
            await server.opened.wait()
            reader, writer = await asyncio.open_connection(
                "127.0.0.1", int(server.url.rstrip("/").rpartition(":")[2])
            )
            writer.write(b"GET /events HTTP/1.1\r\n\r\n")
            while await reader.read(1 << 16):
                pass
        finally:
            writer.transport.abort()
            await cancel(serving)

    async def _play(
        self, entries: tuple[Entry, ...], write: list[Callable[[bytes | None], None]], live: Live
    ) -> None:
        """Sends the bytes at their times."""
        loop = asyncio.get_running_loop()
        begin_s = loop.time()
        for arrival_ns, source, data in entries:
            wait_s = begin_s + (arrival_ns - START_NS) * 1e-9 - loop.time()
            if wait_s > 0.0:
                await asyncio.sleep(wait_s)
            self.states.add(live.engine.state)
            write[source if source >= 0 else -1 - source](data if source >= 0 else None)

    def _outcome(self, names: str, live: Live) -> Outcome:
        lines = self.hearing.data.split(b"\n")
        sent = [Sent.parse(line) for line in lines[:-1]]
        wrong = self.wrong or wrong_in(sent, names)
        missing = live.engine.ports[0].sent - live.sinks[0].dropped - len(sent)
        if live.faults:
            wrong = wrong or f"{live.faults} internal errors: {self.words}"
        if not wrong and (missing or lines[-1]):
            wrong = f"{missing} messages of {len(sent)} were not heard"
        bad = [one.state for one in sent if one.state in SILENT]
        if bad:
            wrong = wrong or f"a message of state {bad[0]}"
        return Outcome(len(sent), frozenset(self.states), f"{names}: {wrong}" if wrong else "")


def run_together(numbers: list[int]) -> list[Outcome]:
    """Cases on one event loop, and what they leave behind."""
    complaints: list[str] = []

    async def all_of_them() -> tuple[list[tuple[Outcome, weakref.ref[Live]]], int]:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: complaints.append(str(context)))
        done = await asyncio.gather(*(_Case(number).run() for number in numbers))
        return done, len(asyncio.all_tasks()) - 1

    before = descriptors()
    with asyncio.Runner(loop_factory=Loop) as runner:
        done, tasks = runner.run(all_of_them())
    gc.collect()
    after = descriptors()
    outcomes = [outcome for outcome, _ in done]
    left = sum(reference() is not None for _, reference in done)
    for what, number in (("descriptors", after - before), ("tasks", tasks), ("running objects", left)):
        if number:
            complaints.append(f"{number} {what} left behind")
    if complaints:
        outcomes.append(Outcome(0, frozenset(), f"cases {numbers[0]} to {numbers[-1]}: {complaints}"))
    return outcomes


def descriptors() -> int:
    """Open file descriptors of this process; 0 where the system does not tell."""
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.exists() else 0


def resident_mb() -> float:
    """Resident memory of this process, without what the allocator keeps back; 0 where the system does not tell."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20 if statm.exists() else 0.0


def main() -> int:
    """Runs cases, prints what was wrong; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--together", type=int, default=20)
    chosen = parser.parse_args()
    for form in ("waterlinked-json", "pd0"):
        for losses in range(len(LOSSES)):
            for step_ns in STEPS:
                recorded(form, losses, step_ns)
    start, messages, wrong = time.monotonic(), 0, 0
    states: Counter[str] = Counter()
    memory: list[float] = []
    last = chosen.first + chosen.cases
    for first in range(chosen.first, last, chosen.together):
        for outcome in run_together(list(range(first, min(first + chosen.together, last)))):
            messages += outcome.messages
            states.update(outcome.states)
            if outcome.wrong:
                wrong += 1
                print(f"of the cases from {first}: {outcome.wrong}", flush=True)
        memory.append(resident_mb())
    grown = memory[-1] - memory[len(memory) // 10]
    print(
        f"{chosen.cases} cases of {SECONDS:g} s through sockets, {chosen.together} together: {messages} messages, "
        f"{wrong} wrong; memory grew by {grown:.1f} MB; states seen in cases: {dict(states)}; "
        f"{time.monotonic() - start:.0f} s"
    )
    return 1 if wrong or grown > GROWTH_BOUND_MB else 0


if __name__ == "__main__":
    with probe_registered():
        raise SystemExit(main())
