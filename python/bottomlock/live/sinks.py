"""Where the bytes of the ports go: sockets, serial lines, files. A target that is absent is tried again, and shown.

Estimates are of the moment: what cannot be written at once is dropped and counted. Where a receiver does not keep up,
a fifth of a second of them waits on this side at most, or two messages.
"""

import asyncio
import contextlib
import math
import socket
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from bottomlock.errors import OutputError
from bottomlock.live.connections import (
    FIRST_WAIT_S,
    LONGEST_WAIT_S,
    Connection,
    accept,
    listen,
    no_answer,
    words_of,
)
from bottomlock.ports.address import Address
from bottomlock.ports.port import Answers

MOST_RECEIVERS = 32
"""Clients of one TCP server."""
WAITING_S = 0.2
"""Longest time that a message waits on this side while others are written behind it."""
WARN_AGAIN_S = 60.0
"""Time between two warnings of a receiver that falls behind."""
_SEND_BUFFER_BYTES = 8192
"""Of a TCP socket. By default the system holds megabytes that it cannot send: minutes of estimates."""


class Sink:
    """A target of bytes. `state` says in words what it does; `dropped` counts the messages that were not written."""

    state = "not opened yet"
    dropped = 0

    def __init__(self, say: Callable[[str], None] = lambda _: None) -> None:
        self._say = say
        self._warned_s = -math.inf

    def write(self, data: bytes) -> bool:
        """Writes bytes at once, or drops them; whether somebody was given them."""
        raise NotImplementedError

    async def run(self) -> None:
        """Keeps the target open until it is cancelled."""
        raise NotImplementedError

    def _fell_behind(self) -> None:
        """A receiver has not taken what it was sent before."""
        now_s = time.monotonic()
        if now_s - self._warned_s > WARN_AGAIN_S:
            self._warned_s = now_s
            self._say(
                "a receiver reads too slowly, messages are dropped: set rate_hz below what it reads a second"
            )


class _Writer:
    """Writes to a socket or a serial line whatever its receiver takes in time; the rest is not written."""

    def __init__(self, transport: Any) -> None:  # noqa: ANN401 - asyncio's or the serial library's
        self.transport = transport
        self._waiting: deque[tuple[float, int]] = deque()
        """When each message was written that the receiver may not have, and its length."""
        one = transport.get_extra_info("socket")
        self._is_udp = hasattr(transport, "sendto")
        is_ip = one is not None and one.family in {socket.AF_INET, socket.AF_INET6}
        self._socket = one if is_ip and not self._is_udp else None
        if self._socket is not None:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
            if hasattr(socket, "TCP_NOTSENT_LOWAT"):
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, 1)

    def write(self, data: bytes) -> bool:
        """Whether the bytes were written."""
        now = time.monotonic()
        held = self._bytes()
        while self._waiting and sum(size for _, size in self._waiting) - self._waiting[0][1] >= held:
            self._waiting.popleft()
        late = len(self._waiting) > 1 and now - self._waiting[0][0] > WAITING_S
        if late or self.transport.get_write_buffer_size():
            return False
        (self.transport.sendto if self._is_udp else self.transport.write)(data)
        self._waiting.append((now, len(data)))
        return True

    def _bytes(self) -> int:
        """What has not been sent, and on Linux what has not been acknowledged."""
        unsent = int(self.transport.get_write_buffer_size())
        if self._socket is None or sys.platform != "linux":
            return unsent
        import fcntl  # noqa: PLC0415 - not on Windows
        import termios  # noqa: PLC0415 - not on Windows

        # A socket that is being closed has no descriptor.
        with contextlib.suppress(OSError, ValueError):
            held = fcntl.ioctl(self._socket.fileno(), termios.TIOCOUTQ, bytes(4))
            unsent += int.from_bytes(held, sys.byteorder)
        return unsent


class _Connected(Sink):
    """A TCP or UDP socket or a serial line, kept open as a source is, and perhaps one of a source."""

    def __init__(self, connection: Connection, say: Callable[[str], None], *, own: bool) -> None:
        super().__init__(say)
        self._connection, self._own = connection, own
        self._writer: _Writer | None = None

    @property
    def state(self) -> str:  # type: ignore[override]
        """What the connection does."""
        return self._connection.state

    def write(self, data: bytes) -> bool:
        transport = self._connection.transport
        if self._writer is None or self._writer.transport is not transport:
            self._writer = None if transport is None else _Writer(transport)
        if self._writer is not None:
            if self._writer.write(data):
                return True
            self._fell_behind()
        self.dropped += 1
        return False

    async def run(self) -> None:
        if self._own:
            await self._connection.run()


class _Client(asyncio.Protocol):
    """A receiver of a TCP server; of what it sends only questions are answered."""

    def __init__(self, changed: Callable[["_Client"], None], answers: Answers) -> None:
        self.writer: _Writer | None = None
        self.closed = False
        self._changed, self._answers = changed, answers

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.writer = _Writer(transport)
        self._changed(self)

    def data_received(self, data: bytes) -> None:
        if self.writer is not None and (answer := self._answers(data)):
            self.writer.write(answer)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's
        self.closed = True
        self._changed(self)


class _Server(Sink):
    """A TCP server: every client gets every message; with `MOST_RECEIVERS` of them a further one is sent away."""

    def __init__(self, address: Address, say: Callable[[str], None], answers: Callable[[], Answers]) -> None:
        super().__init__(say)
        self._address, self._answers = address, answers
        self._clients: set[_Client] = set()

    def write(self, data: bytes) -> bool:
        written = [client.writer.write(data) for client in self._clients if client.writer is not None]
        if False in written:
            self._fell_behind()
        self.dropped += written.count(False) if written else 1
        return any(written)

    def _changed(self, client: _Client) -> None:
        (self._clients.discard if client.closed else self._clients.add)(client)
        self.state = f"{len(self._clients)} clients"

    async def _add(self, client: socket.socket) -> None:
        if len(self._clients) == MOST_RECEIVERS:
            client.close()
            return
        loop = asyncio.get_running_loop()
        await loop.connect_accepted_socket(lambda: _Client(self._changed, self._answers()), client)

    def _show(self, words: str) -> None:
        self.state = words

    async def run(self) -> None:
        servers: list[socket.socket] = []
        wait_s = FIRST_WAIT_S
        while not servers:
            try:
                servers = await listen(self._address.host, self._address.port)
            except OSError as error:
                wait_s = min(2.0 * wait_s, LONGEST_WAIT_S)
                self.state = f"cannot be opened: {words_of(error)}; next attempt in {wait_s:g} s"
                await asyncio.sleep(wait_s)
        self.state = "0 clients"
        try:
            await asyncio.gather(*(accept(server, self._add, self._show) for server in servers))
        finally:
            for server in servers:
                server.close()
            for client in self._clients:
                if client.writer is not None:
                    client.writer.transport.close()


class _File(Sink):
    """A file to which messages are appended, or stdout."""

    def __init__(self, address: Address) -> None:
        super().__init__()
        self._file: IO[bytes]
        if address.kind == "stdout":
            self._file = sys.stdout.buffer
        else:
            try:
                self._file = Path(address.path).open("ab")  # noqa: SIM115 - open while the program runs
            except OSError as error:
                raise OutputError(
                    f"cannot be written ({error.strerror or error})", place=address.path
                ) from error
        self.state = "writing"

    def write(self, data: bytes) -> bool:
        try:
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            self.dropped += 1
            self.state = f"cannot be written: {error.strerror or error}"
            return False
        self.state = "writing"
        return True

    async def run(self) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            if self._file is not sys.stdout.buffer:
                self._file.close()


def open_sink(
    address: Address,
    say: Callable[[str], None],
    answers: Callable[[], Answers] = lambda: no_answer,
    *,
    shared: Connection | None = None,
) -> Sink:
    """The sink of an address.

    Args:
        address: where to.
        say: is told what a connection does, and that a receiver falls behind.
        answers: gives for each client what to send back on bytes that come back.
        shared: the connection of a source at this address: a device is opened once.

    Raises:
        OutputError: for a file that cannot be opened.
    """
    if shared is not None:
        return _Connected(shared, say, own=False)
    if address.kind == "tcpin":
        return _Server(address, say, answers)
    if address.kind in {"file", "stdout"}:
        return _File(address)
    connection = Connection(
        address,
        on_data=lambda _: False,
        on_connected=lambda: None,
        on_state=say,
        silence_s=math.inf,
        answers=answers(),
    )
    return _Connected(connection, say, own=True)
