"""Sources of bytes: opened, watched, and opened again with back-off when they end; never given up silently."""

import asyncio
import contextlib
import math
import os
import socket
import stat
import sys
import time
from collections.abc import Callable
from typing import Any

from bottomlock.errors import DataError
from bottomlock.live.listening import accept, listen
from bottomlock.ports.address import Address
from bottomlock.support.extras import install

FIRST_WAIT_S, LONGEST_WAIT_S = 0.2, 5.0
SHORTEST_SILENCE_S = 5.0
"""A connection is made anew after so long without a byte, or ten periods of its source."""
SLOWED = "sends more than can be read: it has used up its share of the time"
SECOND = "a second client sends at the same time: it is not read"
HELD_S, DROPPING_S = 1.0, 0.01
"""Where a client has given a reading within `HELD_S`, another is not read: a piece of it in `DROPPING_S` is dropped."""
MOST_CLIENTS = 8
"""Connections that a listening source holds; a further one takes the place of that which is silent longest."""
_BLOCK = 65_536
_PIECE = 1024
"""Bytes that are taken from a socket at once: between two pieces the others have their turn."""

OnData = Callable[[bytes], bool]
OnState = Callable[[str], None]
Answers = Callable[[bytes], bytes]


def no_answer(_: bytes) -> bytes:
    """Nothing is sent back."""
    return b""


class Allowance:
    """A share of the loop's time for one source, so that it cannot stop the others.

    Bytes that give a reading may take half of the time, others an eighth; both are averaged over about a second.
    """

    SHARE, FRUITLESS, BURST_S = 0.5, 4.0, 0.5

    def __init__(self) -> None:
        self._left_s, self._at = self.BURST_S, 0.0

    def wait_s(self, now: float) -> float:
        """How long nothing may be taken, s; 0 where the share is not used up."""
        self._left_s = min(self._left_s + self.SHARE * (now - self._at), self.BURST_S)
        self._at = now
        return max(-self._left_s, 0.0) / self.SHARE

    @property
    def is_whole(self) -> bool:
        """Whether nothing of it is used."""
        return self._left_s == self.BURST_S

    def spend(self, took_s: float, *, fruitful: bool) -> None:
        """Counts the time that some bytes took."""
        self._left_s -= took_s if fruitful else self.FRUITLESS * took_s


class _Stream(asyncio.Protocol):
    """Hands on the bytes of a pipe or serial line; `closed` is done when it ends.

    `on_data` says for how long no more may be taken, s.
    """

    def __init__(self, on_data: Callable[["_Stream", bytes], float]) -> None:
        self.closed: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self.transport: Any = None
        self.heard = asyncio.get_running_loop().time()
        self._on_data = on_data

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        loop = asyncio.get_running_loop()
        self.heard = loop.time()
        wait_s = self._on_data(self, data)
        if wait_s > 0.0:
            self.transport.pause_reading()
            loop.call_later(wait_s, self._resume)

    def _resume(self) -> None:
        if not self.closed.done() and not self.transport.is_closing():
            self.transport.resume_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.closed.done():
            self.closed.set_result(words_of(exc) if exc else "closed by the other side")


class _Pieces(_Stream, asyncio.BufferedProtocol):
    """The same of a socket, which is read in small pieces."""

    def __init__(self, on_data: Callable[[_Stream, bytes], float]) -> None:
        super().__init__(on_data)
        self._buffer = bytearray(_PIECE)

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002 - asyncio's
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self.data_received(bytes(self._buffer[:nbytes]))


class Datagrams(asyncio.DatagramProtocol):
    """Hands on the bytes of each datagram, and sends the answer to whom it came from."""

    def __init__(self, on_data: Callable[[bytes], object], answers: Answers) -> None:
        self._on_data, self._answers = on_data, answers
        self._transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As asyncio calls it."""
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:  # noqa: ANN401 - asyncio's
        """As asyncio calls it."""
        if answer := self._answers(data):
            self._transport.sendto(answer, addr)
        self._on_data(data)


def words_of(error: BaseException) -> str:
    """An error in one line."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return text.splitlines()[0]


class Connection:
    """One source: keeps it open.

    Args:
        address: where its bytes come from.
        on_data: is given the bytes as they come, and says whether they gave a reading.
        on_connected: is called at each connection.
        on_state: is given what happens, in words.
        silence_s: longest time without a byte before a connection is made anew.
        on_transport: is given the transport of a stream at each connection, and None at its end.
        answers: what to send back on bytes of a socket or serial line.

    Attributes:
        state: what the connection does now, in words.
        attempts: how often it was tried to open.
        dropped: datagrams and messages beyond the source's share of the time, and pieces of a second client, which
            were not read.
    """

    def __init__(
        self,
        address: Address,
        *,
        on_data: OnData,
        on_connected: Callable[[], None],
        on_state: OnState,
        silence_s: float,
        on_transport: Callable[[Any], None] = lambda _: None,
        answers: Answers = no_answer,
    ) -> None:
        self._answers = answers
        self._on_transport = on_transport
        self.address = address
        self.state = "not opened yet"
        self.attempts = 0
        self.dropped = 0
        self._allowance = Allowance()
        self._fruitful = False
        self._unslowed = ""
        self._on_data, self._on_connected, self._on_state = on_data, on_connected, on_state
        self._silence_s = max(silence_s, SHORTEST_SILENCE_S)
        self._heard = 0.0

    def _say(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self._on_state(state)

    def _take(self, data: bytes) -> None:
        self._heard = asyncio.get_running_loop().time()
        began = time.thread_time()
        self._fruitful = self._on_data(data)
        self._allowance.spend(time.thread_time() - began, fruitful=self._fruitful)

    def _take_all(self, _: _Stream, data: bytes) -> float:
        self._take(data)
        return 0.0

    def _take_within_share(self, stream: _Stream, data: bytes) -> float:
        """Takes bytes; how long no more may be taken, s."""
        if answer := self._answers(data):
            stream.transport.write(answer)
        self._tell_share()
        self._take(data)
        return self._tell_share()

    def _take_datagram(self, data: bytes) -> None:
        if self._tell_share() > 0.0:
            self.dropped += 1
        else:
            self._take(data)

    def _tell_share(self) -> float:
        """Says where the share is used up, and where all of it is there again; how long nothing may be taken, s."""
        wait_s = self._allowance.wait_s(time.perf_counter())
        if wait_s > 0.0 and self.state != SLOWED:
            self._unslowed = self.state
            self._say(SLOWED)
        elif self.state == SLOWED and self._allowance.is_whole:
            self._say(self._unslowed)
        return wait_s

    async def run(self) -> None:
        """Opens the source, and again whenever it ends; returns at the end of a file.

        Raises:
            DataError: for what no further attempt can mend: a library that is not installed.
        """
        wait_s = FIRST_WAIT_S
        while True:
            self.attempts += 1
            heard = self._heard
            try:
                why = await self._once()
            except OSError as error:
                why = f"cannot be opened: {words_of(error)}"
            if why is None:
                return
            wait_s = FIRST_WAIT_S if self._heard > heard else min(wait_s * 2.0, LONGEST_WAIT_S)
            self._say(f"{why}; next attempt in {wait_s:g} s")
            await asyncio.sleep(wait_s)

    async def _once(self) -> str | None:
        """One connection from its beginning to its end; why it ended, None for the end of a file."""
        kind = self.address.kind
        if kind == "udpin":
            return await self._datagrams()
        if kind == "tcpin":
            return await self._server()
        if kind == "stdin" or (kind == "file" and not _is_regular(self.address.path)):
            return await self._pipe()
        if kind == "file":
            await self._file()
            return None
        return await self._stream()

    def _opened(self, words: str) -> None:
        self._heard = asyncio.get_running_loop().time()
        self._say(words)
        self._on_connected()

    async def _stream(self) -> str:
        loop, address = asyncio.get_running_loop(), self.address
        if address.kind == "serial":
            create = _serial_connection()
            transport, protocol = await create(
                loop, lambda: _Stream(self._take_within_share), address.path, baudrate=address.baud
            )
        else:
            async with asyncio.timeout(LONGEST_WAIT_S):
                transport, protocol = await loop.create_connection(
                    lambda: _Pieces(self._take_within_share), address.host, address.port
                )
        self._on_transport(transport)
        self._opened("connected")
        try:
            return await self._until_silent(protocol.closed)
        finally:
            self._on_transport(None)
            transport.abort()

    async def _until_silent(self, closed: "asyncio.Future[str]") -> str:
        loop = asyncio.get_running_loop()
        while True:
            left_s = self._heard + self._silence_s - loop.time()
            if left_s <= 0.0:
                return f"silent for {self._silence_s:g} s"
            done, _ = await asyncio.wait({closed}, timeout=None if math.isinf(left_s) else left_s)
            if done:
                return closed.result()

    async def _datagrams(self) -> str:
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: Datagrams(self._take_datagram, self._answers),
            local_addr=(self.address.host, self.address.port),
        )
        self._opened("listening")
        try:
            await asyncio.Event().wait()
        finally:
            transport.close()
        return "closed"

    async def _server(self) -> str:
        clients: list[_Stream] = []
        speaker: _Stream | None = None
        heard = -math.inf

        def take(client: _Stream, data: bytes) -> float:
            nonlocal speaker, heard
            now = asyncio.get_running_loop().time()
            if client is not speaker:
                if speaker is not None and not speaker.closed.done() and now - heard < HELD_S:
                    self.dropped += 1
                    self._say(SECOND)
                    return DROPPING_S
                # A record that another client has begun does not go on here; who sends nothing changes nothing.
                speaker = client
                if self.state != SLOWED:
                    self._say("connected")
                self._on_connected()
            wait_s = self._take_within_share(client, data)
            if self._fruitful:
                heard = now
            return wait_s

        async def add(client: socket.socket) -> None:
            _, stream = await asyncio.get_running_loop().connect_accepted_socket(
                lambda: _Pieces(take), client
            )
            clients[:] = [one for one in clients if not one.closed.done()]
            if len(clients) == MOST_CLIENTS:
                clients.pop(clients.index(min(clients, key=lambda one: one.heard))).transport.abort()
            clients.append(stream)

        servers = await listen(self.address.host, self.address.port)
        self._say("listening")
        try:
            await asyncio.gather(*(accept(server, add, self._say) for server in servers))
        finally:
            for one in servers:
                one.close()
            for stream in clients:
                stream.transport.abort()
        return "closed"

    async def _pipe(self) -> str | None:
        loop = asyncio.get_running_loop()
        if self.address.kind == "stdin":
            pipe: Any = sys.stdin.buffer
        else:
            # Not blocking: a FIFO opens before there is a writer.
            pipe = os.fdopen(os.open(self.address.path, os.O_RDONLY | os.O_NONBLOCK), "rb", 0)
        transport, protocol = await loop.connect_read_pipe(lambda: _Stream(self._take_all), pipe)
        self._opened("connected")
        try:
            why = await protocol.closed
        finally:
            transport.close()
        if self.address.kind == "stdin":
            self._say("ended")
            return None
        return why

    async def _file(self) -> None:
        with open(self.address.path, "rb") as file:  # noqa: ASYNC230, PTH123 - a regular file does not block
            self._opened("reading")
            while block := file.read(_BLOCK):
                self._take(block)
                await asyncio.sleep(0)
        self._say("ended")


def _is_regular(path: str) -> bool:
    return stat.S_ISREG(os.stat(path).st_mode)  # noqa: PTH116 - a missing one raises OSError, as it must


def _serial_connection() -> Any:  # noqa: ANN401 - an extra
    try:
        import serial_asyncio_fast  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DataError(f"serial lines need pyserial-asyncio-fast: {install('live')}") from error
    return serial_asyncio_fast.create_serial_connection


async def cancel(task: "asyncio.Task[Any]") -> None:
    """Ends a task and waits for its end."""
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task
