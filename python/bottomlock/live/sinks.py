"""Targets of bytes, a class for each transport. One that is absent is tried again, and shown.

Estimates are of the moment: what cannot be written at once is dropped and counted. Where a receiver does not keep up,
a fifth of a second of them waits on this side at most, or two messages. A simulated instrument writes its records
`whole`, whatever waits, and leaves a receiver that is far behind.
"""

import asyncio
import contextlib
import math
import socket
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Any

from bottomlock.errors import OutputError
from bottomlock.live.loop import Kept, TcpServer, words_of
from bottomlock.live.sources import Source, no_answer, open_source
from bottomlock.ports.address import Address
from bottomlock.ports.port import Answers

MOST_RECEIVERS = 32
"""Clients of one TCP server."""
WAITING_S = 0.2
"""Longest time that a message waits on this side while others are written behind it."""
WARN_AGAIN_S = 60.0
"""Time between two warnings of a receiver that falls behind."""
MOST_BEHIND_BYTES = 1 << 20
"""Of whole records, beyond which a receiver is left."""
_SEND_BUFFER_BYTES = 8192
"""Of a TCP socket. By default the system holds megabytes that it cannot send: minutes of estimates."""
PATIENCE_S = 5.0
"""Longest time that a receiver which takes nothing is waited for, where all is to arrive."""
POLL_S = 0.002


class Receiver:
    """Takes the bytes of a socket, a serial line or a terminal: of estimates only those that it takes in time.

    Args:
        transport: asyncio's or the serial library's.
        whole: whether every byte is written.
    """

    def __init__(self, transport: Any, *, whole: bool = False) -> None:  # noqa: ANN401
        self.transport, self._whole = transport, whole
        self._send = getattr(transport, "sendto", None) or transport.write
        self._waiting: deque[tuple[float, int]] = deque()
        """When each message was written that the receiver may not have, and its length."""
        line = transport.get_extra_info("socket")
        is_tcp = line is not None and line.family in {socket.AF_INET, socket.AF_INET6}
        is_tcp = is_tcp and line.type == socket.SOCK_STREAM
        self._socket = line if is_tcp and not whole else None
        if self._socket is not None:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
            if hasattr(socket, "TCP_NOTSENT_LOWAT"):
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, 1)

    @property
    def unwritten(self) -> int:
        """Bytes that the system has not taken."""
        return int(self.transport.get_write_buffer_size())

    def write(self, data: bytes) -> bool:
        """Whether the bytes were written."""
        if self._whole:
            if self.unwritten > MOST_BEHIND_BYTES:
                self.transport.abort()
                return False
        elif self._is_late() or self.unwritten:
            return False
        self._send(data)
        self._waiting.append((time.monotonic(), len(data)))
        return True

    def _is_late(self) -> bool:
        """Whether it has not taken in time what it was sent before."""
        waiting, held = self._waiting, self._held()
        while waiting and sum(size for _, size in waiting) - waiting[0][1] >= held:
            waiting.popleft()
        return len(waiting) > 1 and time.monotonic() - waiting[0][0] > WAITING_S

    def _held(self) -> int:
        """Bytes that have not been sent, and on Linux those that have not been acknowledged."""
        if self._socket is None or sys.platform != "linux":
            return self.unwritten
        import fcntl  # noqa: PLC0415 - not on Windows
        import termios  # noqa: PLC0415 - not on Windows

        held = bytes(4)
        # A socket that is being closed has no descriptor.
        with contextlib.suppress(OSError, ValueError):
            held = fcntl.ioctl(self._socket.fileno(), termios.TIOCOUTQ, held)
        return self.unwritten + int.from_bytes(held, sys.byteorder)


class Sink(Kept):
    """A target of bytes; `run` raises OutputError for a file that cannot be opened.

    Args:
        say: is told what happens, and that a receiver falls behind.

    Attributes:
        where: the address at which another program opens it.
        dropped: messages that were not written.
    """

    where = ""
    dropped = 0

    def __init__(self, say: Callable[[str], None] = lambda _: None) -> None:
        super().__init__(say)
        self._warned_s = -math.inf

    @property
    def receivers(self) -> Iterable[Receiver]:
        """Who is there."""
        return ()

    def write(self, data: bytes) -> bool:
        """Writes bytes at once, or drops them; whether somebody was given them."""
        written = [one.write(data) for one in self.receivers]
        self.dropped += written.count(False) if written else 1
        now_s = time.monotonic()
        if False in written and now_s - self._warned_s > WARN_AGAIN_S:
            self._warned_s = now_s
            self._on_state(
                "a receiver reads too slowly, messages are dropped: set rate_hz below what it reads a second"
            )
        return any(written)

    async def drained(self, most_bytes: float = 0) -> None:
        """Waits until no receiver has more bytes unwritten; one that takes nothing for `PATIENCE_S` is left."""
        for one in list(self.receivers):
            left, since_s = one.unwritten, time.monotonic()
            while left > most_bytes and not one.transport.is_closing():
                await asyncio.sleep(POLL_S)
                before, left = left, one.unwritten
                since_s = since_s if left == before else time.monotonic()
                if time.monotonic() - since_s > PATIENCE_S:
                    one.transport.abort()

    def part(self) -> None:
        """Closes every connection that came, once what was sent has left; new ones are taken."""

    async def finish(self) -> None:
        """Waits until all that can leave has left."""
        await self.drained()


class _Line(Sink):
    """A TCP or UDP socket or a serial line, kept open as a source is, and perhaps one of a source."""

    def __init__(
        self,
        address: Address,
        say: Callable[[str], None],
        answers: Answers,
        shared: Source | None,
        *,
        whole: bool,
    ) -> None:
        super().__init__(say)
        self._source = shared or open_source(address, on_data=lambda _: False, on_state=say, answers=answers)
        self._own, self._whole = shared is None, whole
        self._receiver: Receiver | None = None
        ours = {"udpout": f"udpin:{address.host}:{address.port}"}
        self.where = ours.get(address.kind, f"{address.kind}:{address.path}:{address.baud}")

    @property
    def state(self) -> str:  # type: ignore[override]
        """What the connection does."""
        return self._source.state

    @property
    def receivers(self) -> Iterable[Receiver]:
        """The other end, while it is connected."""
        transport = self._source.transport
        if transport is None:
            return ()
        if self._receiver is None or self._receiver.transport is not transport:
            self._receiver = Receiver(transport, whole=self._whole)
        return (self._receiver,)

    async def run(self) -> None:
        if not self._own:
            await asyncio.Event().wait()
        self._source.retries = self.retries
        await self._source.run()


class _Server(Sink):
    """A TCP server: every client gets every message; of what it sends only questions are answered."""

    def __init__(
        self, address: Address, say: Callable[[str], None], answers: Callable[[], Answers], *, whole: bool
    ) -> None:
        super().__init__(say)
        self._address, self._answers, self._whole = address, answers, whole
        self._receivers: dict[asyncio.StreamWriter, Receiver] = {}
        self._server = TcpServer(self._talk, most=MOST_RECEIVERS, say=self._show)

    @property
    def receivers(self) -> Iterable[Receiver]:
        """The clients."""
        return self._receivers.values()

    def _show(self, words: str) -> None:
        self.state = words

    async def _once(self) -> None:
        host = self._address.host

        def opened(port: int) -> None:
            self.where, self.state = f"tcp:{host}:{port}", "0 clients"

        await self._server.run(host, self._address.port, opened)

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        answers, receiver = self._answers(), Receiver(writer.transport, whole=self._whole)
        self._receivers[writer] = receiver
        self.state = f"{len(self._receivers)} clients"
        try:
            while data := await reader.read(4096):
                if answer := answers(data):
                    receiver.write(answer)
        finally:
            self._receivers.pop(writer, None)
            self.state = f"{len(self._receivers)} clients"

    def part(self) -> None:
        for writer in self._receivers:
            writer.close()
        self._receivers.clear()


class _File(Sink):
    """A file to which messages are appended, or stdout."""

    def __init__(self, address: Address, say: Callable[[str], None], mode: str) -> None:
        super().__init__(say)
        self._address, self._mode = address, mode
        self._file: IO[bytes] | None = None
        self.where = f"file:{address.path}"

    def write(self, data: bytes) -> bool:
        if self._file is not None:
            try:
                self._file.write(data)
                self._file.flush()
            except OSError as error:
                self.state = f"cannot be written: {words_of(error)}"
            else:
                self.state = "writing"
                return True
        self.dropped += 1
        return False

    async def _once(self) -> None:
        with contextlib.ExitStack() as closed:
            try:
                self._file = self._opened(closed)
            except OSError as error:
                raise OutputError(
                    f"cannot be written ({words_of(error)})", place=self._address.path
                ) from error
            self.state = "writing"
            await asyncio.Event().wait()

    def _opened(self, closed: contextlib.ExitStack) -> IO[bytes]:
        if self._address.kind == "stdout":
            return sys.stdout.buffer
        return closed.enter_context(Path(self._address.path).open(self._mode))


def open_sink(
    address: Address,
    say: Callable[[str], None],
    answers: Callable[[], Answers] = lambda: no_answer,
    *,
    shared: Source | None = None,
    whole: bool = False,
    mode: str = "ab",
) -> Sink:
    """The sink of an address.

    Args:
        address: where to.
        say: is told what a connection does, and that a receiver falls behind.
        answers: gives for each client what to send back on bytes that come back.
        shared: the source at this address: a device is opened once.
        whole: whether a receiver gets every byte, whatever waits.
        mode: of a file.
    """
    if shared is None and address.kind == "tcpin":
        return _Server(address, say, answers, whole=whole)
    if shared is None and address.kind in {"file", "stdout"}:
        return _File(address, say, mode)
    return _Line(address, say, answers(), shared, whole=whole)
