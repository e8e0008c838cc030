"""An hour of `bottomlock live` through sockets, with what an hour brings: beams that come and go, lines that break.

Usage: python -m tools.live_soak [--hours 1] [--real-time] [--out out/live_soak.json]

DVL (10 Hz, TCP), IMU (100 Hz, UDP), a listener, the health page with a reader, the raw log and a checkpoint every
second, as in a vehicle. The clock goes on to the next timer as soon as no socket is ready, so that an hour passes as
fast as it is computed; `--real-time` takes an hour. Demanded: no internal error, no message in UNSAFE, no velocity more
than 6 sigma off, no descriptor or task left, and memory that grows by at most 1 MB after the first tenth.
"""

from __future__ import annotations

import asyncio
import heapq
import json
import socket
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cyclopts
import numpy as np

from bottomlock.cli.live import serve_page
from bottomlock.errors import DataError
from bottomlock.files.atomic_write import write_text
from bottomlock.live.loop import cancel
from bottomlock.live.runner import Live, begin, host_clock
from bottomlock.ports.estimate import SILENT
from tests.attack.timers import Loop, descriptors, resident_mb
from tests.live.processes import free_port
from tests.live.world import START_NS, VELOCITY, Sent, World, config, probe_registered

SAMPLED_EVERY_S = 10.0
GROWTH_BOUND_MB = 1.0
SIGMA_BOUND = 6.0
DRIFT = 20e-6
"""Of the DVL's clock against the host's."""
DROPPED_EVERY_S = 300.0
"""The DVL closes its connection so often."""
DAMAGED = 0.002
"""Part of the records that are cut in half, come twice or are followed by bytes of nothing."""


def _lost(t: float) -> tuple[int, ...]:
    """Ten minutes' turns: two beams lost, then all for some seconds, then a beam that comes and goes."""
    turn = t % 600.0
    if 60.0 <= turn < 120.0:
        return (1, 2)
    if 120.0 <= turn < 127.0:
        return (0, 1, 2, 3)
    if 200.0 <= turn < 300.0:
        return (int(t * 1.3) % 4,)
    return ()


@dataclass
class _Heard(asyncio.DatagramProtocol):
    """What the listener keeps: counts and the largest error."""

    messages: int = 0
    states: Counter[str] = field(default_factory=Counter)
    worst_sigma: float = 0.0

    def datagram_received(self, data: bytes, addr: object) -> None:  # noqa: ARG002 - asyncio's
        """Judges a message."""
        sent = Sent.parse(data)
        self.messages += 1
        self.states[sent.state] += 1
        error = np.abs(sent.velocity - VELOCITY) / sent.sd
        self.worst_sigma = max(self.worst_sigma, float(error.max()))


def _damaged(arrivals: Iterator[tuple[int, int, bytes]], seed: int) -> Iterator[tuple[int, int, bytes]]:
    """The arrivals with some faults of the line."""
    draw = np.random.default_rng(seed)
    for arrival_ns, source, data in arrivals:
        forms = (data[: len(data) // 2], data + data, data + b"\x00rubbish\n")
        whole = draw.random() >= DAMAGED
        yield arrival_ns, source, data if whole else forms[draw.integers(3)]


@dataclass
class _Soak:
    """One soak on the running loop."""

    hours: float
    seed: int
    folder: Path
    real_time: bool
    heard: _Heard = field(default_factory=_Heard)
    words: Counter[str] = field(default_factory=Counter)
    memory: list[float] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    told_page: asyncio.Event = field(default_factory=asyncio.Event)
    page_port: int = field(default_factory=lambda: free_port(socket.SOCK_STREAM))

    def _say(self, words: str) -> None:
        if "health page" in words:
            self.told_page.set()
        self.words[words.partition(":")[0].partition("/")[0]] += 1

    async def run(self) -> None:
        """Runs it."""
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: self.faults.append(str(context)))
        clients: list[asyncio.StreamWriter] = []
        server = await asyncio.start_server(lambda _, writer: clients.append(writer), "127.0.0.1", 0)
        hearing, _ = await loop.create_datagram_endpoint(lambda: self.heard, local_addr=("127.0.0.1", 0))
        imu_at = "127.0.0.1", free_port(socket.SOCK_DGRAM)
        imu, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, remote_addr=imu_at)
        live = self._live(server.sockets[0].getsockname()[1], imu_at[1], hearing)
        tasks = [loop.create_task(one) for one in (live.run(), serve_page(live, self._say))]
        # The page begins beside the loop, whose time may run ahead of it.
        await self.told_page.wait()
        tasks += [loop.create_task(one) for one in (self._samples(), self._reader())]
        await self._play(clients, imu)
        self.faults += [f"a task ended: {task!r}" for task in tasks if task.done()]
        for task in reversed(tasks):
            await cancel(task)
        imu.close()
        hearing.close()
        for client in clients:
            client.close()
        server.close()
        await asyncio.sleep(1.0)
        if live.faults:
            self.faults.append(f"{live.faults} internal errors")
        if left := len(asyncio.all_tasks()) - 1:
            self.faults.append(f"{left} tasks left behind")

    def _live(self, dvl_port: int, imu_port: int, hearing: asyncio.DatagramTransport) -> Live:
        settings = config(
            "navigation",
            dvl=f"tcp:127.0.0.1:{dvl_port}",
            imu=f"udpin:127.0.0.1:{imu_port}",
            to=f"udpout:127.0.0.1:{hearing.get_extra_info('sockname')[1]}",
            extra=f'[log]\nfolder = "{self.folder}/log"\n[checkpoint]\nfile = "{self.folder}/checkpoint"\n'
            f"[health]\nport = {self.page_port}\n",
        )
        loop = asyncio.get_running_loop()
        begin_s = loop.time()
        clock = host_clock() if self.real_time else lambda: START_NS + round((loop.time() - begin_s) * 1e9)
        engine, log = begin(settings, b"", say=self._say, clock=clock, logged=True)
        return Live(settings, engine, say=self._say, log=log, clock=clock)

    async def _play(self, clients: list[asyncio.StreamWriter], imu: asyncio.DatagramTransport) -> None:
        """The instruments, at their times."""
        loop = asyncio.get_running_loop()
        begin_s = loop.time()
        drop_s, offset_ns = DROPPED_EVERY_S, lambda t: -(10**12) + round(DRIFT * t * 1e9)
        world = World(self.hours * 3600.0, _lost, seed=self.seed, offset_ns=offset_ns)
        # A generator each: an hour of records in a list would be the growth that is looked for.
        for arrival_ns, source, data in _damaged(heapq.merge(world.dvl(), world.imu()), self.seed):
            at_s = (arrival_ns - START_NS) * 1e-9
            if (wait_s := begin_s + at_s - loop.time()) > 0.0:
                await asyncio.sleep(wait_s)
            if source:
                imu.sendto(data)
                continue
            for client in clients:
                client.write(data)
            if at_s > drop_s:
                drop_s += DROPPED_EVERY_S
                while clients:
                    clients.pop().close()

    async def _samples(self) -> None:
        while True:
            await asyncio.sleep(SAMPLED_EVERY_S)
            self.memory.append(resident_mb())

    async def _reader(self) -> None:
        """Someone who has the health page open."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.page_port)
        try:
            writer.write(b"GET /events HTTP/1.1\r\n\r\n")
            while await reader.read(1 << 16):
                pass
        finally:
            writer.transport.abort()


def live_soak(hours: float, *, seed: int = 1, real_time: bool = False) -> dict[str, Any]:
    """Runs so many hours; the figures and the faults."""
    before, began = descriptors(), time.monotonic()
    with tempfile.TemporaryDirectory() as folder, probe_registered():
        soak = _Soak(hours, seed, Path(folder), real_time)
        with asyncio.Runner(loop_factory=None if real_time else Loop) as runner:
            runner.run(soak.run())
        logged_mb = sum(one.stat().st_size for one in Path(folder).rglob("*.mcap")) / 2**20
    if (left := descriptors() - before) > 0:
        soak.faults.append(f"{left} descriptors left behind")
    heard, memory = soak.heard, soak.memory
    grown_mb = memory[-1] - memory[len(memory) // 10] if memory else 0.0
    if grown_mb > GROWTH_BOUND_MB:
        soak.faults.append(f"memory grew by {grown_mb:.2f} MB, expected at most {GROWTH_BOUND_MB:g}")
    if heard.worst_sigma > SIGMA_BOUND:
        soak.faults.append(f"an error of {heard.worst_sigma:.1f} sigma, expected at most {SIGMA_BOUND:g}")
    silent = [state for state in SILENT if heard.states[state]]
    soak.faults += [f"{heard.states[state]} messages in state {state}" for state in silent]
    tenths = [round(one, 2) for one in memory[:: max(len(memory) // 10, 1)]]
    return {
        "hours": hours, "seed": seed, "seconds": round(time.monotonic() - began, 1), "messages": heard.messages,
        "states": dict(heard.states), "worst_sigma": round(heard.worst_sigma, 2), "log_mb": round(logged_mb, 1),
        "said": dict(soak.words),
        "memory_mb": {"grown": round(grown_mb, 2), "each_tenth": tenths},
        "faults": soak.faults,
    }  # fmt: skip


def main(
    *, hours: float = 1.0, seed: int = 1, real_time: bool = False, out: Path = Path("out/live_soak.json")
) -> int:
    """An hour of `bottomlock live` through sockets, with what an hour brings; the exit code is 1 for a fault."""
    if not hours > 0.0:
        raise DataError(f"--hours is {hours:g}, expected above 0")
    result = live_soak(hours, seed=seed, real_time=real_time)
    write_text(out, json.dumps(result, indent=2) + "\n")
    print(json.dumps(result, indent=2))
    return 1 if result["faults"] else 0


if __name__ == "__main__":
    cyclopts.run(main)
