"""Sources of bytes: opened, watched, and opened again with back-off when they end; never given up silently."""

import asyncio
import contextlib
import errno
import math
import os
import signal
import socket
import stat
import sys
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any

from bottomlock.errors import DataError
from bottomlock.ports.address import Address
from bottomlock.ports.port import Answers
from bottomlock.support.extras import install

PACE_S = 0.005
"""Least time between two connections that are accepted: ten thousand of them then take a few percent of the loop."""
RETRY_S = 1.0
"""Wait where the system has no descriptor or no memory for a further connection."""
BACKLOG = 64
"""Connections that the system holds until they are accepted."""
_EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}


async def listen(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen on every address of a host; of port 0 only the first, on a free port.

    Raises:
        OSError: where the address cannot be used.
    """
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    places = list(dict.fromkeys((family, address) for family, _, _, _, address in found))
    sockets: list[socket.socket] = []
    try:
        for family, address in places if port else places[:1]:
            one = socket.socket(family, socket.SOCK_STREAM)
            sockets.append(one)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                one.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            one.setblocking(False)  # noqa: FBT003 - has no keyword
            one.bind(address)
            one.listen(BACKLOG)
    except OSError:
        for one in sockets:
            one.close()
        raise
    return sockets


async def accept(
    server: socket.socket, take: Callable[[socket.socket], Awaitable[None]], say: Callable[[str], None]
) -> None:
    """Accepts connections until it is cancelled.

    Args:
        server: listens; not blocking.
        take: is given each connection, not blocking, and answers for it.
        say: is told when the system has no room for a connection.
    """
    loop = asyncio.get_running_loop()
    while True:
        try:
            client, _ = await loop.sock_accept(server)
        except OSError as error:
            # Anything else concerns the one client, which has gone.
            if error.errno in _EXHAUSTED:
                say(f"no further connection: {error.strerror}")
                await asyncio.sleep(RETRY_S)
            continue
        await take(client)
        await asyncio.sleep(PACE_S)


FIRST_WAIT_S, LONGEST_WAIT_S = 0.2, 5.0
SHORTEST_SILENCE_S = 5.0
"""A connection is made anew after so long without a byte, or ten periods of its source."""
SECOND = "a second client is sent away: the first gives readings"
HELD_S = 5.0
"""A client that has given a reading within this time keeps its place; another is sent away."""
GREETING_S = 1.0
UNHEARD_S = 5.0
"""Time without a refused datagram after which somebody is taken to receive."""
MOST_WAITING = 256
"""Pieces of a source that wait for their turn; beyond them the oldest are dropped and counted."""
_BLOCK = 65_536
_PIECE = 1024
"""Bytes of a stream that are handed on at once: between two pieces the others have their turn."""

OnData = Callable[[bytes], bool]
OnState = Callable[[str], None]


def no_answer(_: bytes) -> bytes:
    """Nothing is sent back."""
    return b""


class _Stream(asyncio.Protocol):
    """Hands on the bytes of a stream; `closed` is done when it ends."""

    def __init__(self, on_data: Callable[["_Stream", bytes], None]) -> None:
        self.closed: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self.transport: Any = None
        self._on_data = on_data

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self._on_data(self, data)

    def connection_lost(self, exc: Exception | None) -> None:
        if not self.closed.done():
            self.closed.set_result(words_of(exc) if exc else "closed by the other side")


class _Datagrams(asyncio.DatagramProtocol):
    """Hands on the bytes of each datagram, and sends the answer to whom it came from."""

    def __init__(
        self, on_data: Callable[[bytes], object], answers: Answers, on_error: Callable[[Exception], None]
    ) -> None:
        self._on_data, self._answers, self._on_error = on_data, answers, on_error
        self._transport: Any = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As asyncio calls it."""
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:  # noqa: ANN401 - asyncio's
        """As asyncio calls it."""
        if answer := self._answers(data):
            self._transport.sendto(answer, addr)
        self._on_data(data)

    def error_received(self, exc: Exception) -> None:
        """As asyncio calls it: mostly because nobody listens where a datagram went."""
        self._on_error(exc)


def words_of(error: BaseException) -> str:
    """An error in one line."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return text.splitlines()[0]


class Connection:
    """A source, or a target that connects, or both at one address: keeps it open.

    Args:
        address: where its bytes come from.
        on_data: is given the bytes as they come, and says whether they gave a reading.
        on_connected: is called at each connection.
        on_state: is given what happens, in words.
        silence_s: longest time without a byte before a connection is made anew.
        answers: what to send back on bytes of a socket or serial line.
        greeting: what to send once a second, to whom says nothing before it is spoken to; None for nothing.

    Attributes:
        state: what the connection does now, in words.
        transport: of what can be written to, while it is open.
        dropped: pieces and datagrams that came faster than they could be taken, and second clients.
    """

    def __init__(
        self,
        address: Address,
        *,
        on_data: OnData,
        on_connected: Callable[[], None],
        on_state: OnState,
        silence_s: float,
        answers: Answers = no_answer,
        greeting: Callable[[], bytes] | None = None,
    ) -> None:
        self._answers, self._greeting = answers, greeting
        self.transport: Any = None
        self.address = address
        self.state = "not opened yet"
        self.dropped = 0
        self._waiting: deque[bytes] = deque()
        self._on_data, self._on_connected, self._on_state = on_data, on_connected, on_state
        self._silence_s = max(silence_s, SHORTEST_SILENCE_S)
        self._heard, self._read = 0.0, -math.inf

    def _say(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self._on_state(state)

    def _take(self, data: bytes) -> None:
        self._heard = asyncio.get_running_loop().time()
        if self._on_data(data):
            self._read = self._heard

    def _wait(self, data: bytes) -> None:
        """Lets a piece wait for its turn."""
        loop = asyncio.get_running_loop()
        self._heard = loop.time()
        if not self._waiting:
            loop.call_soon(self._take_first)
        elif len(self._waiting) == MOST_WAITING:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(data)

    def _take_first(self) -> None:
        """Takes the piece that waits longest; the next one after a turn of the loop."""
        if not self._waiting:  # of a connection before
            return
        data = self._waiting.popleft()
        if self._waiting:
            asyncio.get_running_loop().call_soon(self._take_first)
        self._take(data)

    def _wait_in_pieces(self, stream: _Stream, data: bytes) -> None:
        if answer := self._answers(data):
            stream.transport.write(answer)
        for begin in range(0, len(data), _PIECE):
            self._wait(data[begin : begin + _PIECE])

    async def run(self) -> None:
        """Opens the source, and again whenever it ends; returns at the end of a file.

        Raises:
            DataError: for what no further attempt can mend: a library that is not installed.
        """
        try:
            await self._keep_open()
        finally:
            self._waiting.clear()

    async def _keep_open(self) -> None:
        wait_s = FIRST_WAIT_S
        while True:
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
        if kind in {"udpin", "udpout"}:
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
        # A record that was begun before does not go on here.
        self.dropped += len(self._waiting)
        self._waiting.clear()
        self._heard = asyncio.get_running_loop().time()
        self._say(words)
        self._on_connected()

    async def _stream(self) -> str:
        loop, address = asyncio.get_running_loop(), self.address
        if address.kind == "serial":
            create = _serial_connection()
            transport, protocol = await create(
                loop, lambda: _Stream(self._wait_in_pieces), address.path, baudrate=address.baud
            )
        else:
            async with asyncio.timeout(LONGEST_WAIT_S):
                transport, protocol = await loop.create_connection(
                    lambda: _Stream(self._wait_in_pieces), address.host, address.port
                )
        self.transport = transport
        self._opened("connected")
        greeting = asyncio.create_task(self._greet(transport.write))
        try:
            return await self._until_silent(protocol.closed)
        finally:
            self.transport = None
            await cancel(greeting)
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
        sends, place = self.address.kind == "udpout", (self.address.host, self.address.port)
        words, failed_s = "sending" if sends else "listening", -math.inf
        loop = asyncio.get_running_loop()

        def fail(error: Exception) -> None:
            nonlocal failed_s
            failed_s = loop.time()
            self._say(f"{words}, and nobody receives: {words_of(error)}")

        # A receiver that is not there yet must not end the sending: asyncio hands such errors to the protocol.
        transport, _ = await loop.create_datagram_endpoint(
            lambda: _Datagrams(self._wait, self._answers, fail),
            local_addr=None if sends else place,
            remote_addr=place if sends else None,
        )
        self.transport = transport if sends else None
        self._opened(words)
        greeting = asyncio.create_task(self._greet(transport.sendto))
        try:
            while True:
                await asyncio.sleep(GREETING_S)
                if loop.time() - failed_s > UNHEARD_S:
                    self._say(words)
        finally:
            self.transport = None
            await cancel(greeting)
            transport.close()

    async def _greet(self, send: Callable[[bytes], object]) -> None:
        while self._greeting is not None:
            send(self._greeting())
            await asyncio.sleep(GREETING_S)

    async def _server(self) -> str:
        present: _Stream | None = None

        async def add(client: socket.socket) -> None:
            nonlocal present
            loop = asyncio.get_running_loop()
            if present is not None:
                if not present.closed.done() and loop.time() - self._read < HELD_S:
                    client.close()
                    self.dropped += 1
                    self._say(SECOND)
                    return
                present.transport.abort()
            _, present = await loop.connect_accepted_socket(lambda: _Stream(self._wait_in_pieces), client)
            self._opened("connected")

        servers = await listen(self.address.host, self.address.port)
        self._say("listening")
        try:
            await asyncio.gather(*(accept(server, add, self._say) for server in servers))
        finally:
            for one in servers:
                one.close()
            if present is not None:
                present.transport.abort()
        return "closed"

    async def _pipe(self) -> str | None:
        loop = asyncio.get_running_loop()
        if self.address.kind == "stdin":
            pipe: Any = sys.stdin.buffer
        else:
            # Not blocking: a FIFO opens before there is a writer.
            pipe = os.fdopen(os.open(self.address.path, os.O_RDONLY | os.O_NONBLOCK), "rb", 0)
        transport, protocol = await loop.connect_read_pipe(
            lambda: _Stream(lambda _, data: self._take(data)), pipe
        )
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


def cancel_at_signals() -> None:
    """Cancels this task at SIGINT and SIGTERM; not every system has such handlers."""
    task = asyncio.current_task()
    assert task is not None
    for name in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            asyncio.get_running_loop().add_signal_handler(name, task.cancel)


async def cancel(task: "asyncio.Task[Any]") -> None:
    """Ends a task and waits for its end."""
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task
