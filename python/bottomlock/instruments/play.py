"""Sends the records of several instruments in the order of their times, at the pace of the clock or faster."""

import asyncio
import heapq
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from bottomlock.errors import OutputError
from bottomlock.instruments.schedule import Record
from bottomlock.live.device import NOT_OPENED, POLL_S, Device, no_answer
from bottomlock.live.loop import words_of
from bottomlock.live.transports import open_sink
from bottomlock.ports.address import Address, Kind, forms
from bottomlock.ports.address import parse_address as parse
from bottomlock.ports.port import Answers

KINDS: tuple[Kind, ...] = ("tcpin", "udpout", "serial", "file")
EXPECTED = forms(KINDS)


def parse_address(text: str, option: str) -> Address:
    """The address in a command's option.

    Raises:
        OutputError: naming the option, for what is none of the forms.

    >>> parse_address("tcpin:16171", "--dvl")
    Address(kind='tcpin', host='127.0.0.1', port=16171, path='', baud=0)
    """
    try:
        return parse(text, KINDS, what="where an instrument sends", any_port=True)
    except ValueError as error:
        raise OutputError(error, place=option) from error


UNWRITTEN_BYTES = 65_536
"""At full speed so much may wait for a reader before the next record."""


def sink_of(address: Address, answers: Callable[[], Answers] | None = None, *, force: bool = False) -> Device:
    """Where an instrument sends.

    Args:
        address: where to.
        answers: makes what answers the commands of a client; None for an instrument that takes none.
        force: overwrite a file.
    """
    mode = "wb" if force else "xb"
    return open_sink(address, lambda _: None, answers=answers or (lambda: no_answer), whole=True, mode=mode)


@dataclass(frozen=True)
class Channel:
    """An instrument's records and where they go."""

    name: str
    sink: Device
    records: Callable[[int], Iterator[Record]]
    """Given what is added to the run's times, the records in the order of sending."""

    @property
    def is_server(self) -> bool:
        """Whether clients come."""
        return self.sink.where.startswith("tcp:")

    async def send(self, record: Record, most_bytes: float) -> None:
        """Sends a record once no receiver has more bytes unwritten."""
        sink = self.sink
        if record.data and not sink.write(record.data) and sink.state.startswith("cannot be written"):
            raise OutputError(sink.state, place=sink.where)
        await sink.drained(most_bytes)
        if record.closes:
            sink.part()


async def _until(condition: Callable[[], bool], running: Mapping[str, "asyncio.Task[None]"]) -> None:
    """Waits until a condition holds.

    Raises:
        OutputError: where a sink fails meanwhile.
    """
    while not condition():
        for name, task in running.items():
            if task.done() and isinstance(error := task.exception(), OSError):
                raise OutputError(f"cannot be opened ({words_of(error)})", place=f"--{name}") from error
            if task.done():
                task.result()
        await asyncio.sleep(POLL_S)


async def play(
    channels: Sequence[Channel],
    *,
    speed: float | None,
    opened: Callable[[], None],
    offset_ns: Callable[[], int],
    sent: Callable[[Channel, Record], None],
    wait: bool = True,
) -> None:
    """Opens every sink, sends every record, and closes them, also when cancelled.

    Args:
        channels: the instruments.
        speed: seconds of the run per second; None for as fast as the readers take it.
        opened: called once all are open.
        offset_ns: called at the start: what is added to the run's times.
        sent: called after each record.
        wait: start when every TCP server has a client.

    Raises:
        OutputError: where a sink cannot be opened or written.
        DataError: for a number that the format does not hold.
    """
    loop = asyncio.get_running_loop()
    for channel in channels:
        channel.sink.retries = False
    running = {channel.name: asyncio.create_task(channel.sink.run()) for channel in channels}
    try:
        await _until(lambda: all(channel.sink.state != NOT_OPENED for channel in channels), running)
        opened()
        servers = [channel.sink for channel in channels if wait and channel.is_server]
        await _until(lambda: all(list(sink.receivers) for sink in servers), running)
        offset, most_bytes = offset_ns(), UNWRITTEN_BYTES if speed is None else math.inf

        def named(channel: Channel) -> Iterator[tuple[Channel, Record]]:
            return ((channel, record) for record in channel.records(offset))

        start_s, first_ns = loop.time(), None
        for channel, record in heapq.merge(*map(named, channels), key=lambda pair: pair[1].due_ns):
            first_ns = record.due_ns if first_ns is None else first_ns
            due_s = start_s if speed is None else start_s + (record.due_ns - first_ns) * 1e-9 / speed
            # Also at full speed: a turn of the loop lets clients come, go and be served.
            await asyncio.sleep(max(due_s - loop.time(), 0.0))
            await channel.send(record, most_bytes)
            sent(channel, record)
        for channel in channels:
            await channel.sink.drained()
    finally:
        for task in running.values():
            task.cancel()
        await asyncio.gather(*running.values(), return_exceptions=True)
