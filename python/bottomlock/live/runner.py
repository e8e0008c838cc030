"""One process: connections, engine, sinks, raw log. The only place of live use that reads a clock."""

import asyncio
import contextlib
import gc
import time
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from bottomlock.errors import BottomlockError
from bottomlock.files.atomic_write import write_bytes
from bottomlock.live.checkpoint import begin as begin_engine
from bottomlock.live.checkpoint import pack
from bottomlock.live.config import LiveConfig
from bottomlock.live.device import Device
from bottomlock.live.engine import TICK_NS, Engine, Message
from bottomlock.live.loop import cancel
from bottomlock.live.raw_log import Kind, RawLog
from bottomlock.live.readings import MavlinkReader
from bottomlock.live.transports import open_sink, open_source
from bottomlock.ports.address import Address, sink_address, source_address
from bottomlock.ports.mavlink import Heartbeat, MavlinkPort, MessageIntervals, Timesync
from bottomlock.ports.port import Answers

YOUNG = 1000
"""Container objects since the last collection from which the young ones are looked at; a ping makes some tens."""
WHOLE_EVERY = 200
"""Collections of young objects from one of all objects to the next."""


@contextmanager
def collected_between_readings() -> Iterator[Callable[[], None]]:
    """Ends automatic collection, and gives the function that collects, to be called where nothing waits.

    What exists at the beginning is never looked at again. At the end all is as before.
    """
    automatic = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    collections = 0

    def collect() -> None:
        nonlocal collections
        if gc.get_count()[0] >= YOUNG:
            collections += 1
            gc.collect(2 if collections % WHOLE_EVERY == 0 else 1)

    try:
        yield collect
    finally:
        gc.unfreeze()
        if automatic:
            gc.enable()


SILENT_CONNECTION_PERIODS = 10.0
PAUSE_NS = TICK_NS + 20_000_000
"""Time between two looks at the clock after which the host has run something else: an idle one takes a tick."""
SPOKEN_TO = ("udpout", "serial")
"""Where an autopilot may say nothing before it is spoken to: PX4 by UDP and by USB."""

Say = Callable[[str], None]


def host_clock() -> Callable[[], int]:
    """A clock in ns since 1970 that never goes back, also when the host's is set."""
    offset_ns = time.time_ns() - time.monotonic_ns()
    return lambda: time.monotonic_ns() + offset_ns


class Live:
    """A running `bottomlock live`.

    Args:
        config: the configuration.
        engine: made of it.
        say: is given what a user should know, a line each.
        log: the raw log; None for none.
        send: is given the messages in place of the sinks (a dry run).
        sinks: the targets of the ports, in place of those that their addresses name.
        clock: host's clock, ns since 1970, never falling.
        real_time: whether that clock goes on by itself, so that a pause of the process shows in it.
    """

    _ran_ns, _running = 0, False
    _saved: Future[None] | None = None
    _unsaved = ""
    """Why the last checkpoint was not written; "" where it was."""

    def __init__(
        self,
        config: LiveConfig,
        engine: Engine,
        *,
        say: Say,
        log: RawLog | None = None,
        send: Callable[[Message], None] | None = None,
        sinks: list[Device] | None = None,
        clock: Callable[[], int] | None = None,
        real_time: bool = True,
    ) -> None:
        self.config, self.engine, self.log = config, engine, log
        self.clock = clock or host_clock()
        self.faults, self._real_time = 0, real_time
        self._say, self._send = say, send
        self.sources = [self._source(place) for place in range(len(config.source))]
        if sinks is None:
            sinks = [] if send is not None else list(self._sinks())
        self.sinks = sinks
        self._saver = ThreadPoolExecutor(max_workers=1)
        self._state = engine.state

    def _source(self, place: int) -> Device:
        section = self.config.source[place]
        address = source_address(section.address)
        speaks = isinstance(self.engine.sources[place].reader, MavlinkReader)
        return open_source(
            address,
            partial(self._say_of, f"source {section.name}"),
            on_data=lambda data: self.arrive(place, data),
            on_connected=lambda: self.connected(place),
            silence_s=SILENT_CONNECTION_PERIODS / section.rate_hz,
            answers=partial(self._answers, address),
            greeting=Heartbeat() if speaks and address.kind in SPOKEN_TO else None,
        )

    def _sinks(self) -> Iterator[Device]:
        """A target of each port; one that several ports, or a source, have the same address of is opened once."""
        known = {source.address.device: source for source in self.sources}
        for section in self.config.port:
            address = sink_address(section.to)
            say = partial(self._say_of, f"port {section.port}")
            sink = open_sink(address, say, answers=partial(self._answers, address))
            yield known.setdefault(address.device, sink)

    def _say_of(self, name: str, words: str) -> None:
        self._say(f"{name}: {words}")

    def _answers(self, address: Address) -> Answers:
        """What answers at an address: TIMESYNC on the clock of the estimates' stamps, requests, commands.

        It is no estimate, and not in the raw log.
        """
        found: list[Answers] = []
        ports = [
            one.port
            for section, one in zip(self.config.port, self.engine.ports, strict=True)
            if sink_address(section.to).device == address.device
        ]
        readers = [
            (section, one.reader)
            for section, one in zip(self.config.source, self.engine.sources, strict=True)
            if source_address(section.address) == address and isinstance(one.reader, MavlinkReader)
        ]
        if readers or any(isinstance(one, MavlinkPort) for one in ports):
            timesync = Timesync()
            found.append(lambda data: timesync.answers(data, self.clock()))
        for section, reader in readers:
            if section.request_hz is not None and self._send is None:
                intervals = MessageIntervals(reader.wanted(section.request_hz), section.system)
                found.append(lambda data, asks=intervals: asks.answers(data, self.clock()))  # type: ignore[misc]
        found += [answers for one in ports if (answers := one.answers()) is not None]
        return lambda data: b"".join(answers(data) for answers in found)

    def arrive(self, place: int, data: bytes) -> bool:
        """Bytes of a source: through the engine to the sinks, then to the raw log; whether they gave a reading."""
        now_ns, source = self._now(), self.engine.sources[place]
        taken = source.used
        self._deliver("in", place, now_ns, data, lambda: self.engine.arrive(place, now_ns, data))
        return source.used > taken

    def connected(self, place: int) -> None:
        """A source was connected."""
        now_ns = self._now()
        self._deliver("connected", place, now_ns, b"", lambda: self.engine.connected(place, now_ns))

    def _now(self) -> int:
        """The time, once the engine knows of a pause of this process until now, of which its ticks tell."""
        now_ns, ran_ns = self.clock(), time.monotonic_ns()
        pause_ns, self._ran_ns = ran_ns - self._ran_ns, ran_ns
        if self._running and pause_ns > PAUSE_NS:
            self._deliver("paused", 0, now_ns, b"%d" % pause_ns, lambda: self.engine.paused(pause_ns, now_ns))
        return now_ns

    def _deliver(
        self, kind: Kind, place: int, now_ns: int, data: bytes, work: Callable[[], list[Message]]
    ) -> None:
        messages: list[Message] = []
        try:
            messages = work()
            for message in messages:
                self._write(message)
        except Exception:  # noqa: BLE001 - a fault of ours must not end the process, and must be seen
            self.faults += 1
            self.engine.fail(f"internal error: {traceback.format_exc(limit=-1).splitlines()[-1]}")
            self._say(f"internal error, nothing is sent any more:\n{traceback.format_exc()}")
        finally:
            if self.log is not None:
                self._logged(kind, place, now_ns, data, messages)
        self._told()

    def _logged(self, kind: Kind, place: int, now_ns: int, data: bytes, messages: list[Message]) -> None:
        assert self.log is not None
        try:
            self.log.write(kind, place, now_ns, data)
            for message in messages:
                self.log.write("out", message.port, now_ns, message.data)
        except BottomlockError as error:
            # Navigation goes on without a log; the page and the terminal say so.
            self._say(f"raw log ended: {error}")
            self.log = None

    def _write(self, message: Message) -> None:
        if self._send is not None:
            self._send(message)
        else:
            self.sinks[message.port].write(message.data, message.port)

    def _told(self) -> None:
        if self.engine.state != self._state:
            self._state = self.engine.state
            self._say(f"state {self._state}: {self.engine.machine.why}")

    async def run(self) -> None:
        """Runs until every source has ended, which only files and pipes do, or until it is cancelled."""
        with collected_between_readings() as collect:
            await self._run(collect)

    async def _run(self, collect: Callable[[], None]) -> None:
        async def again(period_s: float, work: Callable[[Live], None]) -> None:
            while True:
                await asyncio.sleep(period_s)
                work(self)
                collect()

        targets = [
            asyncio.create_task(one.run()) for one in dict.fromkeys(self.sinks) if one not in self.sources
        ]
        works = [asyncio.create_task(again(*one)) for one in periodic(self.config)]
        sources = {asyncio.create_task(source.run()) for source in self.sources}
        running = set(sources)
        try:
            while running:
                # A target ends only where nothing can mend it.
                ended, _ = await asyncio.wait({*running, *targets}, return_when=asyncio.FIRST_COMPLETED)
                for task in ended:
                    task.result()
                running -= ended
        finally:
            for task in (*sources, *targets, *works):
                await cancel(task)
            self.close()

    def close(self) -> None:
        """Ends the raw log, once the last checkpoint is on the disk."""
        self._saver.shutdown()
        if self.log is not None:
            self.log.close()

    def tick(self) -> None:
        """Does what depends on time alone."""
        self.engine.advance(self._now())
        self._running = self._real_time
        self._told()

    def flush(self) -> None:
        """Hands the raw log to the system."""
        if self.log is not None:
            with contextlib.suppress(BottomlockError):
                self.log.flush()

    def save(self) -> None:
        """Saves the navigator; the disk is waited for in a thread, so that no ping waits."""
        if self.config.checkpoint is None or (self._saved is not None and not self._saved.done()):
            return
        content = pack(self.engine, self.clock())
        if content is not None:
            self._saved = self._saver.submit(self._write_checkpoint, self.config.checkpoint.file, content)

    def _write_checkpoint(self, file: str, content: bytes) -> None:
        fault = ""
        try:
            write_bytes(Path(file), content)
        except BottomlockError as error:
            fault = f"no checkpoint: {error}"
        if fault != self._unsaved:  # a full disk is said once, and not at every attempt
            self._unsaved = fault
            self._say(fault or "checkpoints are written again")


def periodic(config: LiveConfig) -> list[tuple[float, Callable[[Live], None]]]:
    """What a running navigation does again and again: after how many seconds, and what."""
    works: list[tuple[float, Callable[[Live], None]]] = [(TICK_NS * 1e-9, Live.tick)]
    if config.log is not None:
        works.append((max(config.log.flush_s, TICK_NS * 1e-9), Live.flush))
    if config.checkpoint is not None:
        works.append((config.checkpoint.every_s, Live.save))
    return works


def begin(
    config: LiveConfig, text: bytes, *, say: Say, clock: Callable[[], int], logged: bool
) -> tuple[Engine, RawLog | None]:
    """The engine, from a checkpoint where there is a young one, and its raw log.

    Raises:
        OutputError: where no raw log can be written.
    """
    engine, checkpoint, words = begin_engine(config, clock())
    if words:
        say(words)
    if config.log is None or not logged:
        return engine, None
    log = RawLog(
        Path(config.log.folder),
        sources=[one.name for one in config.source],
        ports=[one.port for one in config.port],
        start={"config.toml": text} | ({} if checkpoint is None else {"checkpoint": checkpoint}),
    )
    say(f"raw log {log.path}")
    return engine, log
