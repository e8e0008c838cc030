"""Sources of bytes: opened, watched, and opened again with back-off when they end; never given up silently."""

import asyncio
import contextlib
import math
import os
import stat
import sys
from collections.abc import Callable
from typing import Any

from bottomlock.address import Address
from bottomlock.errors import DataError

FIRST_WAIT_S, LONGEST_WAIT_S = 0.2, 5.0
SHORTEST_SILENCE_S = 5.0
"""A connection is made anew after so long without a byte, or ten periods of its source."""
_BLOCK = 65_536

OnData = Callable[[bytes], None]
OnState = Callable[[str], None]


class _Stream(asyncio.Protocol):
    """Hands on the bytes of a connection; `closed` is done when it ends."""

    def __init__(self, on_data: OnData, clients: set["_Stream"] | None = None) -> None:
        self.closed: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self.transport: asyncio.BaseTransport | None = None
        self._on_data, self._clients = on_data, clients

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport
        if self._clients is not None:
            self._clients.add(self)

    def data_received(self, data: bytes) -> None:
        self._on_data(data)

    def connection_lost(self, exc: Exception | None) -> None:
        if self._clients is not None:
            self._clients.discard(self)
        if not self.closed.done():
            self.closed.set_result(words_of(exc) if exc else "closed by the other side")


class _Datagrams(asyncio.DatagramProtocol):
    """Hands on the bytes of each datagram."""

    def __init__(self, on_data: OnData) -> None:
        self._on_data = on_data

    def datagram_received(self, data: bytes, addr: Any) -> None:  # noqa: ANN401, ARG002 - asyncio's
        self._on_data(data)


def words_of(error: BaseException) -> str:
    """An error in one line."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return text.splitlines()[0]


class Connection:
    """One source: keeps it open.

    Args:
        address: where its bytes come from.
        on_data: is given the bytes as they come.
        on_connected: is called at each connection.
        on_state: is given what happens, in words.
        silence_s: longest time without a byte before a connection is made anew.
        on_transport: is given the transport of a stream at each connection, and None at its end.

    Attributes:
        state: what the connection does now, in words.
        attempts: how often it was tried to open.
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
    ) -> None:
        self._on_transport = on_transport
        self.address = address
        self.state = "not opened yet"
        self.attempts = 0
        self._on_data, self._on_connected, self._on_state = on_data, on_connected, on_state
        self._silence_s = max(silence_s, SHORTEST_SILENCE_S)
        self._heard = 0.0

    def _say(self, state: str) -> None:
        if state != self.state:
            self.state = state
            self._on_state(state)

    def _take(self, data: bytes) -> None:
        self._heard = asyncio.get_running_loop().time()
        self._on_data(data)

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
                loop, lambda: _Stream(self._take), address.path, baudrate=address.baud
            )
        else:
            async with asyncio.timeout(LONGEST_WAIT_S):
                transport, protocol = await loop.create_connection(
                    lambda: _Stream(self._take), address.host, address.port
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
            lambda: _Datagrams(self._take), local_addr=(self.address.host, self.address.port)
        )
        self._opened("listening")
        try:
            await asyncio.Event().wait()
        finally:
            transport.close()
        return "closed"

    async def _server(self) -> str:
        clients: set[_Stream] = set()

        def client() -> _Stream:
            self._on_connected()
            return _Stream(self._take, clients)

        server = await asyncio.get_running_loop().create_server(client, self.address.host, self.address.port)
        self._say("listening")
        try:
            await asyncio.Event().wait()
        finally:
            # Not waited for: a client that stays would hold up the end from Python 3.12 on.
            server.close()
        return "closed"

    async def _pipe(self) -> str | None:
        loop = asyncio.get_running_loop()
        if self.address.kind == "stdin":
            pipe: Any = sys.stdin.buffer
        else:
            # Not blocking: a FIFO opens before there is a writer.
            pipe = os.fdopen(os.open(self.address.path, os.O_RDONLY | os.O_NONBLOCK), "rb", 0)
        transport, protocol = await loop.connect_read_pipe(lambda: _Stream(self._take), pipe)
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
        raise DataError("serial lines need pyserial-asyncio-fast: pip install 'bottomlock[live]'") from error
    return serial_asyncio_fast.create_serial_connection


async def cancel(task: "asyncio.Task[Any]") -> None:
    """Ends a task and waits for its end."""
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task
