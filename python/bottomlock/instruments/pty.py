"""A pseudo terminal, which a reader opens as a serial device."""

import asyncio
import os
import time
from collections.abc import Iterable
from pathlib import Path

from bottomlock.errors import OutputError
from bottomlock.live.sinks import POLL_S, Receiver, Sink
from bottomlock.ports.port import Answers

PATIENCE_S = 0.5
"""After so long without a reader the bytes of a full line are lost, as on a cable that nobody holds."""
SETTLED_S = 0.2
"""A terminal on which nothing waits for so long has passed on everything."""


class Pty(Sink):
    """A pseudo terminal; `where` is the device that a reader opens, through a link where one is named."""

    def __init__(self, link: Path | None, answers: Answers) -> None:
        super().__init__()
        self._link, self._answers = link, answers
        self._receivers: tuple[Receiver, ...] = ()
        self._device, self._abandoned = -1, False

    @property
    def receivers(self) -> Iterable[Receiver]:
        """The terminal: it does not show whether somebody reads."""
        return self._receivers

    async def _once(self) -> None:
        try:
            import tty  # noqa: PLC0415 - not on Windows

            line, self._device = os.openpty()
            tty.setraw(self._device)
        except (ImportError, OSError) as error:
            raise OutputError(
                f"this system gives none ({error})", place="pty", hint="use tcp or udp"
            ) from error
        loop, reader = asyncio.get_running_loop(), asyncio.StreamReader()
        heard, _ = await loop.connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(os.dup(line), "rb", 0)
        )
        written, _ = await loop.connect_write_pipe(asyncio.BaseProtocol, os.fdopen(line, "wb", 0))
        self._receivers = (Receiver(written),)
        try:
            self._name()
            self.state = "open"
            while data := await reader.read(4096):
                written.write(self._answers(data))
        finally:
            if self._link is not None and self._link.is_symlink():
                self._link.unlink()
            heard.close()
            written.abort()
            os.close(self._device)

    def _name(self) -> None:
        """Links to the device where that is wanted."""
        device = os.ttyname(self._device)
        self.where = f"pty:{self._link or device}"
        if self._link is None:
            return
        try:
            if self._link.is_symlink():
                self._link.unlink()
            self._link.symlink_to(device)
        except OSError as error:
            raise OutputError(f"pty:{self._link}: cannot be made ({error.strerror or error})") from error

    async def drained(self, most_bytes: float = 0) -> None:  # noqa: ARG002 - a line holds little
        """Waits for a slow reader, but only once for one that is not there."""
        (receiver,) = self._receivers
        begin_s = time.monotonic()
        while receiver.unwritten and not self._abandoned:
            await asyncio.sleep(POLL_S)
            self._abandoned = time.monotonic() - begin_s > PATIENCE_S
        self._abandoned = receiver.unwritten > 0

    async def finish(self) -> None:
        """Returns once the reader has everything, or reads nothing for a while."""
        import fcntl  # noqa: PLC0415 - not on Windows
        import termios  # noqa: PLC0415 - not on Windows

        def waiting() -> int:
            held = fcntl.ioctl(self._device, termios.FIONREAD, bytes(4))
            return int.from_bytes(held, "little")

        await self.drained()
        # What was written reaches the reader's side a little later: nothing must be waiting for a while.
        left, since_s = waiting(), time.monotonic()
        while time.monotonic() - since_s < (PATIENCE_S if left else SETTLED_S):
            await asyncio.sleep(0.02)
            before, left = left, waiting()
            since_s = since_s if left == before else time.monotonic()
