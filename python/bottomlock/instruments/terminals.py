"""Serial lines on asyncio: a pseudo terminal for a reader on this machine, and a serial device."""

import asyncio
import contextlib
import os
from pathlib import Path

from bottomlock.errors import OutputError
from bottomlock.instruments.transports import NewAnswers, Transport, no_answers

PATIENCE_S = 0.5
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
            async with asyncio.timeout(PATIENCE_S):
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
        while idle_s < (PATIENCE_S if left else SETTLED_S):
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
