"""Senders of bytes on asyncio: a TCP server, UDP, a file; terminals are in `terminals.py`."""

import asyncio
import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import IO

from bottomlock.errors import OutputError

NewAnswers = Callable[[], Callable[[bytes], bytes]]
"""Makes, for a client, what to send back on its bytes."""


def no_answers() -> Callable[[bytes], bytes]:
    """Of an instrument that takes no commands."""
    return lambda _: b""


PATIENCE_S = 5.0
"""At full speed, a TCP client that takes nothing for so long is dropped."""

MOST_BEHIND = 1 << 20
"""In real time, a TCP client that is so many bytes behind is dropped: it must not hold up the others."""


class Transport:
    """Where bytes go. `where` names the place as the user can open it, once it is open."""

    def __init__(self, where: str) -> None:
        self.where = where

    async def open(self) -> None:
        """Makes it ready to send.

        Raises:
            OutputError: where that is not possible, in one line.
        """
        raise NotImplementedError

    async def ready(self) -> None:
        """Returns once somebody reads, where that can be known; else at once."""

    async def send(self, data: bytes) -> None:
        """Sends bytes to everybody who reads; where nobody does, they are lost."""
        raise NotImplementedError

    async def reconnect(self) -> None:
        """Ends the connections, where there are any; new ones are taken."""

    async def close(self) -> None:
        """Sends what is left and ends."""
        raise NotImplementedError


class TcpServer(Transport):
    """A server for any number of clients, which may come and go; of what they send commands are answered.

    With `patient` it sends as fast as its clients take it; else it keeps its pace, whatever they do.
    """

    def __init__(
        self, host: str, port: int, *, patient: bool = True, answers: NewAnswers = no_answers
    ) -> None:
        super().__init__(f"tcp:{host}:{port}")
        self._patient, self._answers = patient, answers
        self._host, self._port = host, port
        self._clients: set[asyncio.StreamWriter] = set()
        self._arrived = asyncio.Event()
        self._server: asyncio.Server | None = None

    async def open(self) -> None:
        """Listens; port 0 becomes the one that the system gives."""
        try:
            self._server = await asyncio.start_server(self._serve, self._host, self._port)
        except OSError as error:
            why = os.strerror(error.errno) if error.errno else str(error)
            raise OutputError(
                f"tcpin:{self._host}:{self._port}: cannot listen ({why})",
                hint="is the port in use? expected a free port, or 0 for any",
            ) from error
        self._port = self._server.sockets[0].getsockname()[1]
        self.where = f"tcp:{self._host}:{self._port}"

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients.add(writer)
        self._arrived.set()
        answers = self._answers()
        with contextlib.suppress(OSError):
            while data := await reader.read(4096):
                writer.write(answers(data))
                await writer.drain()
        await self._drop(writer)

    async def _drop(self, writer: asyncio.StreamWriter) -> None:
        self._clients.discard(writer)
        writer.close()
        with contextlib.suppress(OSError, TimeoutError):
            async with asyncio.timeout(PATIENCE_S):
                await writer.wait_closed()

    async def ready(self) -> None:
        """Waits for the first client."""
        await self._arrived.wait()

    async def send(self, data: bytes) -> None:
        """Sends to every client; one that does not read is dropped."""
        for writer in list(self._clients):
            writer.write(data)
            if not self._patient:
                if writer.transport.get_write_buffer_size() > MOST_BEHIND:
                    self._clients.discard(writer)
                    writer.transport.abort()
                continue
            try:
                # Not `wait_for`: up to Python 3.11 it loses a cancellation that comes as it ends.
                async with asyncio.timeout(PATIENCE_S):
                    await writer.drain()
            except (OSError, TimeoutError):
                await self._drop(writer)

    async def reconnect(self) -> None:
        """Closes every connection, after what was sent has left."""
        for writer in list(self._clients):
            await self._drop(writer)

    async def close(self) -> None:
        """Closes the server and every connection."""
        if self._server is not None:
            self._server.close()
        await self.reconnect()


class Udp(Transport):
    """Datagrams to one address, a record each."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__(f"udpin:{host}:{port}")
        self._remote = (host, port)
        self._transport: asyncio.DatagramTransport | None = None

    async def open(self) -> None:
        """Resolves the host."""
        loop = asyncio.get_running_loop()
        try:
            self._transport, _ = await loop.create_datagram_endpoint(
                asyncio.DatagramProtocol, remote_addr=self._remote
            )
        except OSError as error:
            raise OutputError(f"cannot be reached ({error.strerror or error})", place=self.where) from error

    async def send(self, data: bytes) -> None:
        """Sends a datagram; one that nobody takes is lost."""
        if self._transport is not None and data:
            self._transport.sendto(data)

    async def close(self) -> None:
        """Closes the socket."""
        if self._transport is not None:
            self._transport.close()
        # The loop sends what is queued at its next turn.
        await asyncio.sleep(0)


class File(Transport):
    """A file; it is never overwritten without `force`."""

    def __init__(self, path: Path, *, force: bool = False) -> None:
        super().__init__(f"file:{path}")
        self._path, self._force = path, force
        self._stream: IO[bytes] | None = None

    async def open(self) -> None:
        """Makes the file."""
        try:
            self._stream = self._path.open("wb" if self._force else "xb")
        except FileExistsError as error:
            raise OutputError(
                "is there already", place=self._path, hint="choose another name, or use --force to replace it"
            ) from error
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror or error})", place=self._path) from error

    async def send(self, data: bytes) -> None:
        """Appends."""
        if self._stream is None:
            return
        try:
            self._stream.write(data)
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror or error})", place=self._path) from error

    async def close(self) -> None:
        """Closes the file."""
        if self._stream is not None:
            self._stream.close()
