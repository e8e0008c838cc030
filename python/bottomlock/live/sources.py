"""Sources of bytes, a class for each transport: opened, watched, and opened again when they end."""

import asyncio
import math
import os
import stat
import sys
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from bottomlock.errors import DataError
from bottomlock.live.loop import LONGEST_WAIT_S, Kept, TcpServer, cancel, words_of
from bottomlock.ports.address import Address
from bottomlock.ports.port import Answers
from bottomlock.support.extras import install

SHORTEST_SILENCE_S = 5.0
"""A connection is made anew after so long without a byte, or ten periods of its source."""
SECOND = "a second client is sent away: the first gives readings"
HELD_S = 5.0
"""A client that has given a reading within this time keeps its place; another is sent away."""
GREETING_S = 1.0
UNHEARD_S = 5.0
"""Time without a refused datagram after which somebody is taken to receive."""
MOST_WAITING = 256
"""Pieces of a source that wait for their turn."""
_BLOCK = 65_536
_PIECE = 1024
"""Bytes of a stream that are handed on at once: between two pieces the others have their turn."""


def no_answer(_: bytes) -> bytes:
    """Nothing is sent back."""
    return b""


class Pieces(deque[bytes]):
    """Pieces that wait for their turn: beyond `maxlen` the oldest is dropped and counted.

    >>> waiting = Pieces(maxlen=2)
    >>> for piece in (b"1", b"2", b"3"): waiting.put(piece)
    >>> waiting.popleft(), waiting.popleft(), waiting.dropped
    (b'2', b'3', 1)
    """

    dropped = 0

    def put(self, piece: bytes) -> None:
        """Adds the newest."""
        self.dropped += len(self) == self.maxlen
        self.append(piece)

    def drop(self) -> None:
        """Drops all of them."""
        self.dropped += len(self)
        self.clear()


class Source(Kept):
    """Bytes of an address; what is open can be written to where that is possible.

    Args:
        address: where the bytes come from.
        on_data: is given the bytes as they come, and says whether they gave a reading.
        on_connected: is called at each connection.
        on_state: is given what happens, in words.
        silence_s: longest time without a byte before a connection is made anew.
        answers: what to send back on bytes of a socket or serial line.
        greeting: what to send once a second, to whom says nothing before it is spoken to; None for nothing.

    Attributes:
        transport: of what can be written to, while it is open.
    """

    def __init__(
        self,
        address: Address,
        *,
        on_data: Callable[[bytes], bool],
        on_connected: Callable[[], None] = lambda: None,
        on_state: Callable[[str], None],
        silence_s: float = math.inf,
        answers: Answers = no_answer,
        greeting: Callable[[], bytes] | None = None,
    ) -> None:
        super().__init__(on_state)
        self.address = address
        self.transport: Any = None
        self._answers, self._greeting = answers, greeting
        self._waiting = Pieces(maxlen=MOST_WAITING)
        self._on_data, self._on_connected = on_data, on_connected
        self._silence_s = max(silence_s, SHORTEST_SILENCE_S)
        self._read_s = -math.inf

    @property
    def dropped(self) -> int:
        """Pieces and datagrams that came faster than they could be taken, and second clients."""
        return self._waiting.dropped

    async def run(self) -> None:
        """Keeps it open; returns at the end of a file. Raises as `Kept.run`."""
        try:
            await super().run()
        finally:
            self._waiting.clear()

    def _take(self, data: bytes) -> None:
        """Hands bytes on at once."""
        self.worked = True
        if self._on_data(data):
            self._read_s = asyncio.get_running_loop().time()

    def _wait(self, piece: bytes) -> None:
        """Lets a piece wait for its turn."""
        if not self._waiting:
            asyncio.get_running_loop().call_soon(self._take_first)
        self._waiting.put(piece)

    def _take_first(self) -> None:
        """Takes the piece that waits longest; the next one after a turn of the loop."""
        if not self._waiting:  # of a connection before
            return
        piece = self._waiting.popleft()
        if self._waiting:
            asyncio.get_running_loop().call_soon(self._take_first)
        self._take(piece)

    def _opened(self, words: str) -> None:
        # A record that was begun before does not go on here.
        self._waiting.drop()
        self._say(words)
        self._on_connected()

    @asynccontextmanager
    async def _open(self, transport: Any, words: str) -> AsyncIterator[None]:  # noqa: ANN401
        """While something is open: who says nothing before it is spoken to is greeted, and a port may write."""
        self.transport = transport
        self._opened(words)
        greeting = asyncio.create_task(self._greet(getattr(transport, "sendto", None) or transport.write))
        try:
            yield
        finally:
            self.transport = None
            await cancel(greeting)
            transport.abort()

    async def _greet(self, send: Callable[[bytes], object]) -> None:
        while self._greeting is not None:
            send(self._greeting())
            await asyncio.sleep(GREETING_S)

    async def _read(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> str:
        """Reads a stream to its end; why it ended."""
        async with self._open(writer.transport, "connected"):
            try:
                while True:
                    async with asyncio.timeout(None if math.isinf(self._silence_s) else self._silence_s):
                        data = await reader.read(_BLOCK)
                    if not data:
                        return "closed by the other side"
                    if answer := self._answers(data):
                        writer.write(answer)
                    for begin in range(0, len(data), _PIECE):
                        self._wait(data[begin : begin + _PIECE])
            except TimeoutError:
                return f"silent for {self._silence_s:g} s"
            except OSError as error:
                return words_of(error)


class _Client(Source):
    """A TCP connection."""

    async def _once(self) -> str:
        async with asyncio.timeout(LONGEST_WAIT_S):
            streams = await self._connect()
        return await self._read(*streams)

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.open_connection(self.address.host, self.address.port)


class _Serial(_Client):
    """A serial line."""

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        try:
            from serial_asyncio_fast import open_serial_connection  # noqa: PLC0415 - an extra
        except ImportError as error:
            raise DataError(f"serial lines need pyserial-asyncio-fast: {install('live')}") from error
        reader, writer = await open_serial_connection(url=self.address.path, baudrate=self.address.baud)
        return reader, writer


class _Server(Source):
    """A TCP server with one client: the one that gives readings, else the last."""

    def __init__(self, address: Address, **settings: Any) -> None:  # noqa: ANN401 - of `Source`
        super().__init__(address, **settings | {"silence_s": math.inf})
        self._server = TcpServer(self._talk, most=1, idle=lambda _: not self._holds(), say=self._say)

    @property
    def dropped(self) -> int:
        """As `Source`."""
        return super().dropped + self._server.sent_away

    async def _once(self) -> None:
        await self._server.run(self.address.host, self.address.port, lambda _: self._say("listening"))

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._read_s = -math.inf
        await self._read(reader, writer)

    def _holds(self) -> bool:
        """Whether the client that is there keeps its place."""
        if asyncio.get_running_loop().time() - self._read_s >= HELD_S:
            return False
        self._say(SECOND)
        return True


class _Datagrams(Source, asyncio.DatagramProtocol):
    """Datagrams that come to an address of ours, or in answer to those that are sent to one; each is a piece."""

    _failed_s = -math.inf

    def datagram_received(self, data: bytes, addr: Any) -> None:  # noqa: ANN401 - asyncio's
        """As asyncio calls it."""
        if answer := self._answers(data):
            self._socket.sendto(answer, addr)
        self._wait(data)

    def error_received(self, exc: Exception) -> None:
        """As asyncio calls it: mostly because nobody listens where a datagram went."""
        self._failed_s = asyncio.get_running_loop().time()
        self._say(f"{self._words}, and nobody receives: {words_of(exc)}")

    async def _once(self) -> str:
        sends, place = self.address.kind == "udpout", (self.address.host, self.address.port)
        self._words, loop = "sending" if sends else "listening", asyncio.get_running_loop()
        # A receiver that is not there yet must not end the sending: asyncio hands such errors to the protocol.
        self._socket, _ = await loop.create_datagram_endpoint(
            lambda: self, local_addr=None if sends else place, remote_addr=place if sends else None
        )
        async with self._open(self._socket, self._words):
            while True:
                await asyncio.sleep(GREETING_S)
                if loop.time() - self._failed_s > UNHEARD_S:
                    self._say(self._words)


class _Pipe(Source):
    """Standard input, which ends for good, or a FIFO; the writer waits while it is not read."""

    async def _once(self) -> str | None:
        loop, reader = asyncio.get_running_loop(), asyncio.StreamReader()
        pipe: Any = sys.stdin.buffer
        if self.address.kind == "file":
            # Not blocking: a FIFO opens before there is a writer.
            pipe = os.fdopen(os.open(self.address.path, os.O_RDONLY | os.O_NONBLOCK), "rb", 0)
        transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), pipe)
        self._opened("connected")
        try:
            while data := await reader.read(_BLOCK):
                self._take(data)
                await asyncio.sleep(0)
        finally:
            transport.close()
        if self.address.kind == "file":
            return "closed by the other side"
        self._say("ended")
        return None


class _File(_Pipe):
    """A file, read once; at the path of a file there may be a FIFO."""

    async def _once(self) -> str | None:
        path = self.address.path
        if not stat.S_ISREG(os.stat(path).st_mode):  # noqa: PTH116 - a missing one raises OSError, as it must
            return await super()._once()
        with open(path, "rb") as file:  # noqa: ASYNC230, PTH123 - a regular file does not block
            self._opened("reading")
            while block := file.read(_BLOCK):
                self._take(block)
                await asyncio.sleep(0)
        self._say("ended")
        return None


_SOURCES: dict[str, type[Source]] = {
    "tcp": _Client,
    "tcpin": _Server,
    "udpin": _Datagrams,
    "udpout": _Datagrams,
    "serial": _Serial,
    "file": _File,
    "stdin": _Pipe,
    "ros": Source,
}
"""A topic is opened by the ROS 2 node."""


def open_source(address: Address, **settings: Any) -> Source:  # noqa: ANN401 - of `Source`
    """The source at an address, which `run` opens; `settings` as of `Source`."""
    return _SOURCES[address.kind](address, **settings)
