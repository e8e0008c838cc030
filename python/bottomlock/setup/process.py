"""The process of `bottomlock live`: started, stopped, and started again when it ends by itself."""

import asyncio
import contextlib
import signal
import sys
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 30.0
"""Wait before a new start, doubled as long as the process lives for less than the longest."""
PATIENCE_S = 5.0
"""Time to end after SIGTERM."""
LINES = 100
"""Last lines of what it said that are kept."""


class LiveProcess:
    """Runs `bottomlock live` on a configuration while it is wanted.

    Args:
        config: the configuration.
        say: is given what the process says, a line each.

    Attributes:
        wanted: whether it shall run.
        lines: the last of what it said.
    """

    def __init__(self, config: Path, say: Callable[[str], None]) -> None:
        self._config, self._say = config, say
        self.wanted = False
        self.lines: deque[str] = deque(maxlen=LINES)
        self._process: asyncio.subprocess.Process | None = None
        self._changed = asyncio.Event()
        self._started_s = 0.0
        self._ended: str | None = None

    def status(self) -> dict[str, Any]:
        """What JSON can hold: whether it runs and shall run, since when, how it ended, its last lines."""
        running = self._process is not None
        return {
            "wanted": self.wanted,
            "running": running,
            "for_s": round(time.monotonic() - self._started_s, 1) if running else None,
            "ended": self._ended,
            "lines": list(self.lines),
        }

    def want(self, *, running: bool) -> None:
        """Starts or stops it."""
        self.wanted = running
        self._changed.set()

    async def restart(self) -> None:
        """Ends it where it runs, so that it begins anew with what the configuration says now."""
        if self._process is not None:
            await self._end(self._process)

    async def run(self) -> None:
        """Keeps it as it is wanted, until it is cancelled; then it ends with us."""
        wait_s = FIRST_WAIT_S
        while True:
            await self._until(wanted=True)
            began = time.monotonic()
            await self._once()
            if not self.wanted:
                wait_s = FIRST_WAIT_S
                continue
            if time.monotonic() - began > LONGEST_WAIT_S:
                wait_s = FIRST_WAIT_S
            self._note(f"live ended: {self._ended}; started again in {wait_s:g} s")
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._until(wanted=False), wait_s)
            wait_s = min(2.0 * wait_s, LONGEST_WAIT_S)

    async def _until(self, *, wanted: bool) -> None:
        while self.wanted is not wanted:
            self._changed.clear()
            await self._changed.wait()

    async def _once(self) -> None:
        """From a start to the end."""
        self._ended = None
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "bottomlock", "live", str(self._config)),
            stdin=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        self._process, self._started_s = process, time.monotonic()
        stopping = asyncio.create_task(self._until(wanted=False))
        reading = asyncio.create_task(self._read(process))
        try:
            await asyncio.wait({stopping, reading}, return_when=asyncio.FIRST_COMPLETED)
            if reading.done():
                # It ends by itself. A signal now could take its exit code away from asyncio, which would report 255.
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(process.wait(), PATIENCE_S)
        finally:
            stopping.cancel()
            await self._end(process)
            await reading
            code = process.returncode
            self._process = None
            self._ended = (
                f"signal {signal.Signals(-code).name}"
                if code is not None and code < 0
                else f"exit code {code}"
            )

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        assert process.stderr is not None
        while line := await process.stderr.readline():
            self._note(line.decode(errors="replace").rstrip())

    def _note(self, line: str) -> None:
        self.lines.append(line)
        self._say(line)

    async def _end(self, process: asyncio.subprocess.Process) -> None:
        if process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        try:
            await asyncio.wait_for(process.wait(), PATIENCE_S)
        except TimeoutError:
            process.kill()
            await process.wait()
