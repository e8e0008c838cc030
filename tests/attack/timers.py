"""An event loop whose time is that of its timers, and what a process holds: for `tools/live_soak.py`."""

import asyncio
import contextlib
import ctypes
import os
import selectors
from pathlib import Path
from typing import Any


class _Selector(selectors.DefaultSelector):
    """Does not wait for a timer: `now_s` goes on to it once no socket is ready."""

    now_s = 0.0

    def select(self, timeout: float | None = None) -> list[Any]:
        """The sockets that are ready; waits only where there is no timer at all."""
        events = super().select(0)
        if events:
            return events
        if timeout is None:
            return super().select(None)
        self.now_s += max(timeout, 0.0)
        return []


class Loop(asyncio.SelectorEventLoop):
    """An event loop whose time is that of its timers."""

    def __init__(self) -> None:
        self._timers = _Selector()
        super().__init__(self._timers)

    def time(self) -> float:
        """Seconds since the loop was made."""
        return self._timers.now_s


def descriptors() -> int:
    """Open file descriptors of this process; 0 where the system does not tell."""
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.exists() else 0


def resident_mb() -> float:
    """Resident memory of this process, without what the allocator keeps back; 0 where the system does not tell."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20 if statm.exists() else 0.0
