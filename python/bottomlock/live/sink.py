"""A target of bytes: what every sink shares."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TypeVar

from bottomlock.live.connections import FIRST_WAIT_S, LONGEST_WAIT_S, words_of

T = TypeVar("T")


class Sink:
    """A target of bytes. `state` says in words what it does; `dropped` counts the messages that were not written."""

    state = "not opened yet"
    dropped = 0

    def write(self, data: bytes) -> None:
        """Writes bytes at once, or drops them."""
        raise NotImplementedError

    async def run(self) -> None:
        """Keeps the target open until it is cancelled."""
        raise NotImplementedError

    async def opened(self, attempt: Callable[[], Awaitable[T]]) -> T:
        """What an attempt to open the target gives, once one succeeds."""
        wait_s = FIRST_WAIT_S
        while True:
            try:
                return await attempt()
            except OSError as error:
                wait_s = min(2.0 * wait_s, LONGEST_WAIT_S)
                self.state = f"cannot be opened: {words_of(error)}; next attempt in {wait_s:g} s"
                await asyncio.sleep(wait_s)
