"""A class of device for each transport, behind `open_source` and `open_sink`."""

import asyncio
import contextlib
import math
import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from bottomlock.errors import DataError, OutputError
from bottomlock.libraries import install
from bottomlock.live.device import BLOCK, GREETING_S, LONGEST_WAIT_S, Device
from bottomlock.live.loop import TcpServer, words_of
from bottomlock.ports.address import Address

SECOND = "a second client is sent away: the first gives readings"
OTHER = "datagrams of a second host are dropped: the first gives readings"
HELD_S = 5.0
"""A client, or a host of datagrams, that has given a reading within this time keeps its place; another waits."""
MOST_RECEIVERS = 32
"""Clients of one target."""
FULL = f"a further client is sent away: there are {MOST_RECEIVERS}"
_CLIENTS = " clients"
UNHEARD_S = 5.0
"""Time without a refused datagram after which somebody is taken to receive."""


class _Client(Device):
    """A TCP connection."""

    async def _once(self) -> str:
        async with asyncio.timeout(LONGEST_WAIT_S):
            streams = await self._connect()
        return await self._read(streams, "connected")

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


class _Server(Device):
    """A TCP server. Of a source it has one client: the one that gives readings, else the last."""

    def __init__(self, *given: Any, **settings: Any) -> None:  # noqa: ANN401 - of `Device`
        super().__init__(*given, **settings | {"silence_s": math.inf})
        most = MOST_RECEIVERS if self._on_data is None else 1
        self._server = TcpServer(self._talk, most=most, idle=lambda _: not self._holds(), say=self._say)

    def _say(self, state: str) -> None:
        if state.endswith(_CLIENTS):
            self.state = state  # a line for each of a thousand clients would hide the others
        else:
            super()._say(state)

    @property
    def not_read(self) -> int:
        """As `Device`."""
        return super().not_read + self._server.sent_away

    async def _once(self) -> None:
        def opened(port: int) -> None:
            self.where = f"tcp:{self.address.host}:{port}"
            self._say(f"0{_CLIENTS}")

        await self._server.run(self.address.host, self.address.port, opened)

    async def _talk(self, *streams: Any) -> None:  # noqa: ANN401 - reader and writer
        self._read_s = -math.inf
        try:
            await self._read(streams, f"{len(self.receivers) + 1}{_CLIENTS}")
        finally:
            self._say(f"{len(self.receivers)}{_CLIENTS}")

    def _holds(self) -> bool:
        """Whether the client that is there keeps its place."""
        if self._on_data is not None and asyncio.get_running_loop().time() - self._read_s >= HELD_S:
            return False
        self._say(FULL if self._on_data is None else SECOND)
        return True


class _Datagrams(Device, asyncio.DatagramProtocol):
    """Datagrams that come to an address of ours, or go to one, with those that answer; each is a piece.

    Of a source they are those of one host: two vehicles are never mixed.
    """

    _failed_s, _from = -math.inf, ""

    def __init__(self, address: Address, *given: Any, **settings: Any) -> None:  # noqa: ANN401 - of `Device`
        super().__init__(address, *given, **settings)
        self._sends, self._answer = address.kind == "udpout", self._answers()
        self._words = "sending" if self._sends else "listening"
        self.where = f"udpin:{address.host}:{address.port}"

    def datagram_received(self, data: bytes, addr: Any) -> None:  # noqa: ANN401 - asyncio's
        """As asyncio calls it."""
        if self._on_data is not None and addr[0] != self._from:
            if asyncio.get_running_loop().time() - self._read_s < HELD_S:
                self._waiting.dropped += 1
                self._warn(OTHER)
                return
            if self._from:
                self._on_connected()  # what the other host has begun does not go on
            self._from = addr[0]
        if answer := self._answer(data):
            self._socket.sendto(answer, addr)
        self._wait(data)

    def error_received(self, exc: Exception) -> None:
        """As asyncio calls it: mostly because nobody listens where a datagram went."""
        self._failed_s = asyncio.get_running_loop().time()
        self._say(f"{self._words}, and nobody receives: {words_of(exc)}")

    async def _once(self) -> str:
        loop, place = asyncio.get_running_loop(), (self.address.host, self.address.port)
        # A receiver that is not there yet must not end the sending: asyncio hands such errors to the protocol.
        self._socket, _ = await loop.create_datagram_endpoint(
            lambda: self,
            local_addr=None if self._sends else place,
            remote_addr=place if self._sends else None,
        )
        async with self._open(self._socket, self._words):
            while True:
                await asyncio.sleep(GREETING_S)
                if loop.time() - self._failed_s > UNHEARD_S:
                    self._say(self._words)


class _Pipe(Device):
    """Standard input, which ends for good, or a FIFO; the writer waits while it is not read."""

    async def _once(self) -> str | None:
        loop, reader = asyncio.get_running_loop(), asyncio.StreamReader()
        pipe: Any = sys.stdin.buffer
        if self.address.path:
            # Not blocking: a FIFO opens before there is a writer.
            pipe = os.fdopen(os.open(self.address.path, os.O_RDONLY | os.O_NONBLOCK), "rb", 0)
        transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), pipe)
        self._opened("connected")
        try:
            while data := await reader.read(BLOCK):
                self._take(data)
                await asyncio.sleep(0)
        finally:
            transport.close()
        if self.address.path:
            return "closed by the other side"
        self._say("ended")
        return None


class _File(_Pipe):
    """A file that is read once; at its path there may be a FIFO."""

    async def _once(self) -> str | None:
        path = self.address.path
        if not stat.S_ISREG(os.stat(path).st_mode):  # noqa: PTH116 - a missing one raises OSError, as it must
            return await super()._once()
        with open(path, "rb") as file:  # noqa: ASYNC230, PTH123 - a regular file does not block
            self._opened("reading")
            while block := file.read(BLOCK):
                self._take(block)
                await asyncio.sleep(0)
        self._say("ended")
        return None


class _Written(Device):
    """A file to which messages are appended, each whole or not at all, or stdout."""

    _file: IO[bytes] | None = None

    def write(self, data: bytes, port: int = 0) -> bool:
        if self._file is not None:
            try:
                self._append(self._file, data)
            except OSError as error:
                self.state = f"cannot be written: {words_of(error)}"
                self._warn(self.state)
            else:
                self.state = "writing"
                self.written[port] += 1
                return True
        self.dropped[port] += 1
        return False

    def _append(self, file: IO[bytes], data: bytes) -> None:
        """Writes a message; what a full disk has taken of it is removed again.

        Raises:
            OSError: where it cannot be written.
        """
        taken = 0
        try:
            while taken < len(data):
                taken += file.write(data[taken:])
            file.flush()
        except OSError:
            with contextlib.suppress(OSError):  # a device or a pipe has no end that moves
                file.truncate(file.tell() - taken)
            raise

    async def _once(self) -> None:
        with contextlib.ExitStack() as closed:
            try:
                self._file = self._of(closed)
            except OSError as error:
                raise OutputError(
                    f"cannot be written ({words_of(error)})", place=self.address.path
                ) from error
            self.state = "writing"
            await asyncio.Event().wait()

    def _of(self, closed: contextlib.ExitStack) -> IO[bytes]:
        if not self.address.path:
            return sys.stdout.buffer
        # Without a buffer, which would keep what the disk has refused and fail again where the file is closed.
        return closed.enter_context(Path(self.address.path).open(self._mode, buffering=0))


_LINES: dict[str, type[Device]] = {
    "tcp": _Client, "tcpin": _Server, "udpin": _Datagrams, "udpout": _Datagrams, "serial": _Serial,
}  # fmt: skip
_SOURCES: dict[str, type[Device]] = {**_LINES, "file": _File, "stdin": _Pipe, "ros": Device}
"""A topic is opened by the ROS 2 node."""
_SINKS: dict[str, type[Device]] = {**_LINES, "file": _Written, "stdout": _Written}


def open_source(address: Address, say: Callable[[str], None], **settings: Any) -> Device:  # noqa: ANN401
    """The device at an address that is read, which `run` opens; `settings` as of `Device`, `on_data` with them."""
    return _SOURCES[address.kind](address, say, **settings)


def open_sink(address: Address, say: Callable[[str], None], **settings: Any) -> Device:  # noqa: ANN401
    """The device at an address that is written to alone, which `run` opens; `settings` as of `Device`."""
    return _SINKS[address.kind](address, say, **settings)
