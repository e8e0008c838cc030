"""What live use opens: a device at an address, read as a source, written to as a target, or both.

Bytes that come faster than they are taken wait in a bounded queue. Of the estimates that a receiver does not take in
time, the newest of each port waits for it, a fifth of a second at most; older ones are dropped and counted. What the
system has taken is a fifth of a second of them too, or two messages. A simulated instrument writes its records `whole`,
whatever waits, and leaves a receiver that is far behind.
"""

import asyncio
import contextlib
import math
import socket
import sys
import time
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

from bottomlock.live.loop import cancel, words_of
from bottomlock.ports.address import Address
from bottomlock.ports.port import Answers

NOT_OPENED = "not opened yet"
FIRST_WAIT_S, LONGEST_WAIT_S = 0.2, 5.0
"""Between two attempts to open something: twice as long each time."""
SHORTEST_SILENCE_S = 5.0
"""A connection is made anew after so long without a byte, or ten periods of its source."""
GREETING_S = 1.0
MOST_WAITING = 256
"""Pieces of a source that wait for their turn."""
WAITING_S = 0.2
"""Longest time that a message waits on this side while others are written behind it."""
AGAIN_S = 0.02
"""Until a receiver that does not keep up is tried again."""
WARN_AGAIN_S = 60.0
"""Time between two warnings of a receiver that falls behind, or a file that cannot be written."""
MOST_BEHIND_BYTES = 1 << 20
"""Of whole records, beyond which a receiver is left."""
PATIENCE_S = 5.0
"""Longest time that a receiver which takes nothing is waited for, where all is to arrive."""
MOST_ANSWERED_BYTES = 1 << 16
"""Of answers that a client has not taken: before that it is not read."""
ANSWERED_S = 0.05
"""Time after an answer in which a mere target's client is not read: the answers of 32 must leave time for a ping."""
POLL_S = 0.002
BLOCK = 65_536
_PIECE = 1024
"""Bytes of a stream that are handed on at once: between two pieces the others have their turn."""
_SEND_BUFFER_BYTES = 8192
"""Of a TCP socket. By default the system holds megabytes that it cannot send: minutes of estimates."""


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


@dataclass(eq=False)
class Outgoing:
    """A message on its way: of which port, since when, and whether a receiver was given it."""

    data: bytes
    port: int
    since_s: float = field(default_factory=time.monotonic)
    is_given: bool = False


class Receiver:
    """Takes the bytes of a socket, a serial line or a terminal: of estimates only those that it takes in time.

    Args:
        transport: asyncio's or the serial library's.
        on_outcome: called with every message, and whether it `is_written` or dropped.
        whole: whether every byte is written.
    """

    def __init__(
        self,
        transport: Any,  # noqa: ANN401
        on_outcome: Callable[..., None] = lambda *_, **__: None,
        *,
        whole: bool = False,
    ) -> None:
        self.transport, self._on_outcome, self._whole = transport, on_outcome, whole
        self._newest: dict[int, Outgoing] = {}
        """What waits for it, by port, the longest first."""
        self._again: asyncio.TimerHandle | None = None
        self.send = getattr(transport, "sendto", None) or transport.write
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

    def write(self, message: Outgoing) -> None:
        """Writes a message, at once or as soon as it is taken; one of the same port that waits for that is dropped."""
        if self._whole:
            is_behind = self.unwritten > MOST_BEHIND_BYTES
            if is_behind:
                self.transport.abort()
            else:
                self.send(message.data)
            self._on_outcome(message, is_written=not is_behind)
            return
        before = self._newest.pop(message.port, None)
        if before is not None:
            self._on_outcome(before, is_written=False)
        self._newest[message.port] = message
        if self._again is None:
            self._pass_on()

    def _pass_on(self) -> None:
        """Writes what waits, oldest first, while it is taken."""
        self._again = None
        for port, message in list(self._newest.items()):
            is_taken = not self._is_late() and not self.unwritten and not self.transport.is_closing()
            if is_taken:
                self.send(message.data)
                self._waiting.append((time.monotonic(), len(message.data)))
            elif not self.transport.is_closing() and time.monotonic() - message.since_s < WAITING_S:
                self._again = asyncio.get_running_loop().call_later(AGAIN_S, self._pass_on)
                return
            del self._newest[port]
            self._on_outcome(message, is_written=is_taken)

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

    async def drained(self, most_bytes: float) -> None:
        """Waits until no more bytes are unwritten; a receiver that takes nothing for `PATIENCE_S` is left."""
        left, since_s = self.unwritten, time.monotonic()
        while left > most_bytes and not self.transport.is_closing():
            await asyncio.sleep(POLL_S)
            before, left = left, self.unwritten
            since_s = since_s if left == before else time.monotonic()
            if time.monotonic() - since_s > PATIENCE_S:
                self.transport.abort()


class Device:
    """What is at an address: opened, and again with back-off whenever it ends; never given up silently.

    Args:
        address: of it.
        say: is given what happens, in words.
        on_data: is given the bytes as they come, and says whether they gave a reading; None for a mere target.
        on_connected: is called at each connection.
        silence_s: longest time without a byte before a connection is made anew.
        answers: makes, for each connection, what to send back on its bytes.
        greeting: what to send once a second, to whom says nothing before it is spoken to; None for nothing.
        whole: whether a receiver gets every byte, whatever waits.
        mode: of a file that is written.

    Attributes:
        state: what it does now, in words.
        where: the address at which another program opens it.
        retries: whether it is tried again where it cannot be opened; else `run` raises OSError.
        receivers: who can be written to.
        written: messages that somebody was given, by port.
        dropped: those that nobody was given, or a receiver not in time, by port.
    """

    retries = True

    def __init__(
        self,
        address: Address,
        say: Callable[[str], None],
        *,
        on_data: Callable[[bytes], bool] | None = None,
        on_connected: Callable[[], None] = lambda: None,
        silence_s: float = math.inf,
        answers: Callable[[], Answers] = lambda: no_answer,
        greeting: Callable[[], bytes] | None = None,
        whole: bool = False,
        mode: str = "ab",
    ) -> None:
        self.address, self.state, self.where = address, NOT_OPENED, str(address)
        self.receivers: list[Receiver] = []
        self.written, self.dropped = Counter[int](), Counter[int]()
        self._on_state, self._on_data, self._on_connected = say, on_data, on_connected
        self._answers, self._greeting = answers, greeting
        self._whole, self._mode = whole, mode
        self._silence_s = max(silence_s, SHORTEST_SILENCE_S)
        self._waiting = Pieces(maxlen=MOST_WAITING)
        self._taken, self._read_s, self._warned_s = 0, -math.inf, -math.inf

    @property
    def not_read(self) -> int:
        """Pieces and datagrams that came faster than they could be taken, and second clients."""
        return self._waiting.dropped

    async def run(self) -> None:
        """Keeps it open; returns at the end of a file.

        Raises:
            DataError: for what no further attempt can mend: a library that is not installed.
            OutputError: for a file that cannot be opened for writing.
        """
        wait_s = FIRST_WAIT_S
        while True:
            taken = self._taken
            try:
                why = await self._once()
            except OSError as error:
                if not self.retries:
                    raise
                why = f"cannot be opened: {words_of(error)}"
            finally:
                self._waiting.clear()
            if why is None:
                return
            wait_s = FIRST_WAIT_S if self._taken > taken else min(wait_s * 2.0, LONGEST_WAIT_S)
            self._say(f"{why}; next attempt in {wait_s:g} s")
            await asyncio.sleep(wait_s)

    async def _once(self) -> str | None:
        """Once from its beginning to its end; why it ended, None for an end for good.

        Raises:
            OSError: where it cannot be opened.
        """
        raise NotImplementedError

    def _say(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self._on_state(state)

    def _take(self, data: bytes) -> None:
        """Hands bytes on at once."""
        self._taken += 1
        if self._on_data is not None and self._on_data(data):
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
    async def _open(self, transport: Any, words: str) -> AsyncIterator[Receiver]:  # noqa: ANN401
        """While a transport is open: who says nothing before it is spoken to is greeted, and it can be written to."""
        receiver = Receiver(transport, self._count, whole=self._whole)
        self.receivers.append(receiver)
        self._opened(words)
        greeting = asyncio.create_task(self._greet(receiver))
        try:
            yield receiver
        finally:
            if receiver in self.receivers:
                self.receivers.remove(receiver)
            await cancel(greeting)
            transport.abort()

    async def _greet(self, receiver: Receiver) -> None:
        while self._greeting is not None:
            receiver.send(self._greeting())
            await asyncio.sleep(GREETING_S)

    async def _read(self, streams: tuple[asyncio.StreamReader, asyncio.StreamWriter], words: str) -> str:
        """Reads a connection to its end; why it ended."""
        reader, writer = streams
        answers, silence_s = self._answers(), None if math.isinf(self._silence_s) else self._silence_s
        async with self._open(writer.transport, words) as receiver:
            try:
                while True:
                    async with asyncio.timeout(silence_s):
                        data = await reader.read(BLOCK)
                    if not data:
                        return "closed by the other side"
                    for begin in range(0, len(data), _PIECE):
                        piece = data[begin : begin + _PIECE]
                        if answer := answers(piece):
                            await self._send_answer(receiver, answer)
                        self._wait(piece)
            except TimeoutError:
                return f"silent for {self._silence_s:g} s"
            except OSError as error:
                return words_of(error)

    async def _send_answer(self, receiver: Receiver, answer: bytes) -> None:
        """Sends an answer; who asks without end, or does not read the answers, is not read meanwhile."""
        receiver.send(answer)
        await receiver.drained(MOST_ANSWERED_BYTES)
        await asyncio.sleep(ANSWERED_S if self._on_data is None else 0.0)

    def write(self, data: bytes, port: int = 0) -> bool:
        """Writes a message of a port, in time or not at all; whether there is a receiver, as for a file."""
        message = Outgoing(data, port)
        for receiver in list(self.receivers):
            receiver.write(message)
        self.dropped[port] += not self.receivers
        return bool(self.receivers)

    def _count(self, message: Outgoing, *, is_written: bool) -> None:
        """Counts a message as written, once for all receivers, or as dropped by one."""
        if is_written:
            self.written[message.port] += not message.is_given
            message.is_given = True
            return
        self.dropped[message.port] += 1
        self._warn(
            "a receiver reads too slowly, messages are dropped: set rate_hz below what it reads a second"
        )

    def _warn(self, words: str) -> None:
        """Says what goes on and on, once in `WARN_AGAIN_S`."""
        now_s = time.monotonic()
        if now_s - self._warned_s > WARN_AGAIN_S:
            self._warned_s = now_s
            self._on_state(words)

    async def drained(self, most_bytes: float = 0) -> None:
        """Waits until no receiver has more bytes unwritten."""
        for receiver in list(self.receivers):
            await receiver.drained(most_bytes)

    def part(self) -> None:
        """Closes every connection once what was sent has left; new ones are taken."""
        for receiver in self.receivers:
            receiver.transport.close()
        self.receivers.clear()
