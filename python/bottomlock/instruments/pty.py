"""A pseudo terminal, which a reader opens as a serial device."""

import asyncio
import contextlib
import os
import time
from pathlib import Path

from bottomlock.errors import OutputError
from bottomlock.live.device import POLL_S, Device, Receiver

PATIENCE_S = 0.5
"""After so long without a reader the bytes of a full line are lost, as on a cable that nobody holds."""
SETTLED_S = 0.2
"""A terminal on which nothing waits for so long has passed on everything."""


class Pty(Device):
    """A pseudo terminal; `where` is the device that a reader opens, through a link where the address names one.

    It does not show whether somebody reads.
    """

    _device, _abandoned = -1, False

    async def _once(self) -> None:
        loop, reader, answers = asyncio.get_running_loop(), asyncio.StreamReader(), self._answers()
        with contextlib.ExitStack() as closed:
            line = self._line(closed)
            heard, _ = await loop.connect_read_pipe(
                lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(os.dup(line), "rb", 0)
            )
            closed.callback(heard.close)
            written, _ = await loop.connect_write_pipe(asyncio.BaseProtocol, os.fdopen(line, "wb", 0))
            closed.callback(written.abort)
            self.receivers, self.state = [Receiver(written)], "open"
            while data := await reader.read(4096):
                written.write(answers(data))

    def _line(self, closed: contextlib.ExitStack) -> int:
        """Our end of a new terminal, raw, with a link to the device where one is named."""
        try:
            import tty  # noqa: PLC0415 - not on Windows

            line, self._device = os.openpty()
            tty.setraw(self._device)
        except (ImportError, OSError) as error:
            raise OutputError(
                f"this system gives none ({error})", place="pty", hint="use tcp or udp"
            ) from error
        closed.callback(os.close, self._device)
        device = os.ttyname(self._device)
        self.where = f"pty:{self.address.path or device}"
        if self.address.path:
            link = Path(self.address.path)
            try:
                if link.is_symlink():
                    link.unlink()
                link.symlink_to(device)
            except OSError as error:
                raise OutputError(f"pty:{link}: cannot be made ({error.strerror or error})") from error
            closed.callback(link.unlink, missing_ok=True)
        return line

    async def drained(self, most_bytes: float = 0) -> None:  # noqa: ARG002 - a line holds little
        """Waits for a slow reader, but only once for one that is not there."""
        (receiver,) = self.receivers
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
