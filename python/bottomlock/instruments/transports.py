"""Senders of bytes on asyncio: a TCP server, UDP, a file, a pseudo terminal for a reader here, a serial device."""

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


LINE_PATIENCE_S = 0.5
"""After so long without a reader the bytes of a full line are lost, as on a cable that nobody holds."""

SETTLED_S = 0.2
"""A pseudo terminal on which nothing waits for so long has passed on everything."""


class _Line(Transport):
    """Bytes to a file descriptor that does not block; it does not show whether somebody reads."""

    def __init__(self, where: str, answers: NewAnswers) -> None:
        super().__init__(where)
        self._line = -1
        self._abandoned = False
        self._answers = answers()

    def _listen(self) -> None:
        """Answers the commands that come from now on."""
        asyncio.get_running_loop().add_reader(self._line, self._read)

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            os.write(self._line, self._answers(os.read(self._line, 4096)))

    async def send(self, data: bytes) -> None:
        """Writes; waits for a slow reader, but only once for one that is not there."""
        view = memoryview(data)
        while view:
            try:
                view = view[os.write(self._line, view) :]
                self._abandoned = False
            except BlockingIOError:
                if self._abandoned or not await self._writable():
                    self._abandoned = True
                    return
            except OSError as error:
                raise OutputError(
                    f"cannot be written ({error.strerror or error})", place=self.where
                ) from error

    async def _writable(self) -> bool:
        loop = asyncio.get_running_loop()
        free = asyncio.Event()
        loop.add_writer(self._line, free.set)
        try:
            async with asyncio.timeout(LINE_PATIENCE_S):
                await free.wait()
        except TimeoutError:
            return False
        finally:
            loop.remove_writer(self._line)
        return True

    async def close(self) -> None:
        """Closes the line."""
        if self._line >= 0:
            asyncio.get_running_loop().remove_reader(self._line)
            os.close(self._line)
            self._line = -1


class Pty(_Line):
    """A pseudo terminal; `where` is the device that a reader opens, through a link where one is named."""

    def __init__(self, link: Path | None, answers: NewAnswers = no_answers) -> None:
        super().__init__("pty", answers)
        self._link = link
        self._device = -1

    async def open(self) -> None:
        """Makes the terminal, raw, and the link to it.

        Raises:
            OutputError: where the system has none, or the link's name is taken.
        """
        try:
            import tty  # noqa: PLC0415 - not on Windows

            self._line, self._device = os.openpty()
            tty.setraw(self._device)
        except (ImportError, OSError) as error:
            raise OutputError(
                f"this system gives none ({error})", place="pty", hint="use tcp or udp"
            ) from error
        os.set_blocking(self._line, False)
        self._listen()
        device = os.ttyname(self._device)
        self.where = f"pty:{device}"
        if self._link is None:
            return
        try:
            if self._link.is_symlink():
                self._link.unlink()
            self._link.symlink_to(device)
        except OSError as error:
            raise OutputError(f"pty:{self._link}: cannot be made ({error.strerror or error})") from error
        self.where = f"pty:{self._link}"

    async def close(self) -> None:
        """Waits until what was written is read, then removes the link and closes both ends."""
        if self._device >= 0:
            await self._read_out()
            if self._link is not None and self._link.is_symlink():
                self._link.unlink()
            os.close(self._device)
            self._device = -1
        await super().close()

    async def _read_out(self) -> None:
        """Returns once the reader has everything, or reads nothing for a while."""
        import fcntl  # noqa: PLC0415 - not on Windows
        import struct  # noqa: PLC0415 - with it
        import termios  # noqa: PLC0415 - not on Windows

        def waiting() -> int:
            count: int = struct.unpack("i", fcntl.ioctl(self._device, termios.FIONREAD, bytes(4)))[0]
            return count

        # What was written reaches the reader's side a little later: nothing must be waiting for a while.
        left, idle_s = waiting(), 0.0
        while idle_s < (LINE_PATIENCE_S if left else SETTLED_S):
            await asyncio.sleep(0.02)
            now = waiting()
            idle_s = idle_s + 0.02 if now == left else 0.0
            left = now


class Serial(_Line):
    """A serial device, 8 data bits, no parity, raw."""

    def __init__(self, path: Path, baud: int, answers: NewAnswers = no_answers) -> None:
        super().__init__(f"serial:{path}:{baud}", answers)
        self._path, self._baud = path, baud

    async def open(self) -> None:
        """Opens the device and sets its speed.

        Raises:
            OutputError: for a missing device, one that is no terminal, or a speed that it does not have.
        """
        try:
            import termios  # noqa: PLC0415 - not on Windows
            import tty  # noqa: PLC0415 - not on Windows
        except ImportError as error:
            raise OutputError(
                "serial devices need a POSIX system", place=self.where, hint="use tcp or udp"
            ) from error
        speed = getattr(termios, f"B{self._baud}", None)
        if speed is None:
            raise OutputError(
                f"{self._baud} baud is no speed of this system", place=self.where, expected="9600, 115200 ..."
            )
        try:
            self._line = os.open(self._path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(self._line)
            settings = termios.tcgetattr(self._line)
            settings[4] = settings[5] = speed
            termios.tcsetattr(self._line, termios.TCSANOW, settings)
            self._listen()
        except (OSError, termios.error) as error:
            with contextlib.suppress(OSError):
                await super().close()
            why = error.args[-1] if error.args else error
            raise OutputError(f"cannot be opened as a serial device ({why})", place=self.where) from error
