"""Where the bytes of the ports go: sockets, serial lines, files. A target that is absent is tried again, and shown.

Estimates are of the moment: what cannot be written at once is dropped and counted. Where a receiver does not keep up,
a fifth of a second of them waits on this side at most, or two messages.
"""

import asyncio
import contextlib
import socket
import sys
import time
from collections import deque
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import IO, Any, TypeVar

from bottomlock.errors import OutputError
from bottomlock.live.connections import (
    FIRST_WAIT_S,
    LONGEST_WAIT_S,
    Answers,
    Connection,
    Datagrams,
    accept,
    listen,
    no_answer,
    words_of,
)
from bottomlock.ports.address import Address

T = TypeVar("T")


class Sink:
    """A target of bytes. `state` says in words what it does; `dropped` counts the messages that were not written."""

    state = "not opened yet"
    dropped = 0

    def write(self, data: bytes) -> None:
        """Writes bytes at once, or drops them."""
        raise NotImplementedError

    async def run(self) -> None:
        """Keeps the target open until it is cancelled."""
        raise NotImplementedError

    async def opened(self, attempt: Callable[[], Awaitable[T]]) -> T:
        """What an attempt to open the target gives, once one succeeds."""
        wait_s = FIRST_WAIT_S
        while True:
            try:
                return await attempt()
            except OSError as error:
                wait_s = min(2.0 * wait_s, LONGEST_WAIT_S)
                self.state = f"cannot be opened: {words_of(error)}; next attempt in {wait_s:g} s"
                await asyncio.sleep(wait_s)


MOST_RECEIVERS = 32
"""Clients of one TCP server."""
WAITING_S = 0.2
"""Longest time that a message waits on this side while others are written behind it."""
_SEND_BUFFER_BYTES = 8192
"""Of a TCP socket. By default the system holds megabytes that it cannot send: minutes of estimates."""


class _Writer:
    """Writes to a socket or a serial line whatever its receiver takes in time; the rest is not written."""

    def __init__(self, transport: Any) -> None:  # noqa: ANN401 - asyncio's or the serial library's
        self.transport = transport
        self._waiting: deque[tuple[float, int]] = deque()
        """When each message was written that the receiver may not have, and its length."""
        one = transport.get_extra_info("socket")
        self._socket = one if one is not None and one.family in {socket.AF_INET, socket.AF_INET6} else None
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
        self.transport.write(data)
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


class _Udp(Sink):
    def __init__(self, address: Address, answers: Answers) -> None:
        self._address, self._answers = address, answers
        self._transport: asyncio.DatagramTransport | None = None

    def write(self, data: bytes) -> None:
        if self._transport is None:
            self.dropped += 1
        else:
            self._transport.sendto(data)

    async def run(self) -> None:
        remote = self._address.host, self._address.port
        # A receiver that is not there yet must not end the sending: asyncio hands such errors to the protocol.
        transport, _ = await self.opened(
            lambda: asyncio.get_running_loop().create_datagram_endpoint(
                lambda: Datagrams(lambda _: None, self._answers), remote_addr=remote
            )
        )
        self._transport = transport
        self.state = "sending"
        try:
            await asyncio.Event().wait()
        finally:
            transport.close()


class _Stream(Sink):
    """A TCP connection or a serial line, kept open as a source is; of what comes back only questions are answered."""

    def __init__(
        self, address: Address, on_state: Callable[[str], None], answers: Callable[[bytes], bytes]
    ) -> None:
        self._writer: _Writer | None = None
        self._connection = Connection(
            address,
            on_data=lambda _: False,
            on_connected=lambda: None,
            on_state=on_state,
            silence_s=float("inf"),
            on_transport=self._use,
            answers=answers,
        )

    def _use(self, transport: Any) -> None:  # noqa: ANN401 - asyncio's or the serial library's
        self._writer = None if transport is None else _Writer(transport)

    @property
    def state(self) -> str:  # type: ignore[override]
        """What the connection does."""
        return self._connection.state

    def write(self, data: bytes) -> None:
        if self._writer is None or not self._writer.write(data):
            self.dropped += 1

    async def run(self) -> None:
        await self._connection.run()


class _Client(asyncio.Protocol):
    """A receiver of a TCP server; what it sends is not read."""

    def __init__(self, changed: Callable[["_Client"], None]) -> None:
        self.writer: _Writer | None = None
        self.closed = False
        self._changed = changed

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.writer = _Writer(transport)
        self._changed(self)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's
        self.closed = True
        self._changed(self)


class _Server(Sink):
    """A TCP server: every client gets every message; with `MOST_RECEIVERS` of them a further one is sent away."""

    def __init__(self, address: Address) -> None:
        self._address = address
        self._clients: set[_Client] = set()

    def write(self, data: bytes) -> None:
        written = [client.writer.write(data) for client in self._clients if client.writer is not None]
        self.dropped += written.count(False) if written else 1

    def _changed(self, client: _Client) -> None:
        (self._clients.discard if client.closed else self._clients.add)(client)
        self.state = f"{len(self._clients)} clients"

    async def _add(self, client: socket.socket) -> None:
        if len(self._clients) == MOST_RECEIVERS:
            client.close()
            return
        await asyncio.get_running_loop().connect_accepted_socket(lambda: _Client(self._changed), client)

    def _say(self, words: str) -> None:
        self.state = words

    async def run(self) -> None:
        servers = await self.opened(lambda: listen(self._address.host, self._address.port))
        self.state = "0 clients"
        try:
            await asyncio.gather(*(accept(server, self._add, self._say) for server in servers))
        finally:
            for server in servers:
                server.close()
            for client in self._clients:
                if client.writer is not None:
                    client.writer.transport.close()


class _File(Sink):
    """A file to which messages are appended, or stdout."""

    def __init__(self, address: Address) -> None:
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

    def write(self, data: bytes) -> None:
        try:
            self._file.write(data)
            self._file.flush()
        except OSError as error:
            self.dropped += 1
            self.state = f"cannot be written: {error.strerror or error}"

    async def run(self) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            if self._file is not sys.stdout.buffer:
                self._file.close()


def open_sink(address: Address, on_state: Callable[[str], None], answers: Answers = no_answer) -> Sink:
    """The sink of an address.

    Args:
        address: where to.
        on_state: is told what a connection does.
        answers: what to send back on bytes that come back, over UDP, TCP that connects, and serial lines.

    Raises:
        OutputError: for a file that cannot be opened.
    """
    if address.kind == "udpout":
        return _Udp(address, answers)
    if address.kind == "tcpin":
        return _Server(address)
    if address.kind in {"file", "stdout"}:
        return _File(address)
    return _Stream(address, on_state, answers)
