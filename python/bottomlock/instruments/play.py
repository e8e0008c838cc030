"""Sends the records of several instruments in the order of their times, at the pace of the clock or faster."""

import asyncio
import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from bottomlock.errors import OutputError
from bottomlock.instruments.schedule import Record
from bottomlock.instruments.transports import (
    File,
    NewAnswers,
    Pty,
    Serial,
    TcpServer,
    Transport,
    Udp,
    no_answers,
)
from bottomlock.ports.address import Address, Kind, forms
from bottomlock.ports.address import parse_address as parse

KINDS: tuple[Kind, ...] = ("tcpin", "udpout", "pty", "serial", "file")
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


def transport_of(
    address: Address, *, force: bool = False, patient: bool = True, answers: NewAnswers = no_answers
) -> Transport:
    """The transport of an address; it is opened in the event loop.

    Args:
        address: where to send.
        force: overwrite a file.
        patient: a TCP server waits for slow clients, as at full speed it should; else it keeps its pace.
        answers: makes what answers the commands of a client.
    """
    if address.kind == "tcpin":
        return TcpServer(address.host, address.port, patient=patient, answers=answers)
    if address.kind == "udpout":
        return Udp(address.host, address.port)
    if address.kind == "pty":
        return Pty(Path(address.path) if address.path else None, answers)
    path = Path(address.path)
    return Serial(path, address.baud, answers) if address.kind == "serial" else File(path, force=force)


@dataclass(frozen=True)
class Channel:
    """An instrument's records and where they go."""

    name: str
    transport: Transport
    records: Callable[[int], Iterator[Record]]
    """Given what is added to the run's times, the records in the order of sending."""


async def _due(channel: Channel, record: Record, wait_s: float) -> None:
    # Also at full speed: a turn of the loop lets clients come, go and be served.
    await asyncio.sleep(max(wait_s, 0.0))
    if record.data:
        await channel.transport.send(record.data)
    if record.closes:
        await channel.transport.reconnect()


async def play(
    channels: Sequence[Channel],
    *,
    speed: float | None,
    opened: Callable[[], None],
    offset_ns: Callable[[], int],
    sent: Callable[[Channel, Record], None],
    wait: bool = True,
) -> None:
    """Opens every transport, sends every record, and closes them, also when cancelled.

    Args:
        channels: the instruments.
        speed: seconds of the run per second; None for as fast as the readers take it.
        opened: called once all are open.
        offset_ns: called at the start: what is added to the run's times.
        sent: called after each record.
        wait: start when every TCP server has a client.

    Raises:
        OutputError: where a transport cannot be opened or written.
        DataError: for a number that the format does not hold.
    """
    loop = asyncio.get_running_loop()
    try:
        for channel in channels:
            await channel.transport.open()
        opened()
        if wait:
            for channel in channels:
                await channel.transport.ready()
        offset = offset_ns()

        def named(channel: Channel) -> Iterator[tuple[Channel, Record]]:
            return ((channel, record) for record in channel.records(offset))

        start_s, first_ns = loop.time(), None
        for channel, record in heapq.merge(*map(named, channels), key=lambda pair: pair[1].due_ns):
            first_ns = record.due_ns if first_ns is None else first_ns
            due_s = start_s if speed is None else start_s + (record.due_ns - first_ns) * 1e-9 / speed
            await _due(channel, record, due_s - loop.time())
            sent(channel, record)
    finally:
        for channel in channels:
            await channel.transport.close()
