"""Sessions of zenoh: one for each endpoint, which the sources and targets of a process share.

Without an endpoint a session is a peer that finds others by multicast; with one it is a client of the router there.
"""

import asyncio
import contextlib
import json
import threading
from typing import Any

from bottomlock.errors import DataError
from bottomlock.support.extras import install


def library() -> Any:  # noqa: ANN401 - an extra
    """The library.

    Raises:
        DataError: where eclipse-zenoh is not installed.
    """
    try:
        import zenoh  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DataError(
            f"addresses zenoh:KEY and ros:/TOPIC need eclipse-zenoh: {install('zenoh')}"
        ) from error
    return zenoh


class Session:
    """A session with those who use it; `entities` counts what they have declared as parts of a ROS node."""

    def __init__(self, endpoint: str) -> None:
        self.zenoh: Any = _opened(endpoint)
        self.users = 0
        self.entities = 0
        self.node: Any = None
        """The token of the ROS node; None before the first of its parts."""


_sessions: dict[str, Session] = {}
_lock = threading.Lock()


def join(endpoint: str) -> Session:
    """The session of an endpoint, opened where there is none; waits for the network.

    Raises:
        OSError: where it cannot be opened.
    """
    with _lock:
        session = _sessions.get(endpoint)
        if session is None:
            session = _sessions[endpoint] = Session(endpoint)
        session.users += 1
        return session


async def joined(endpoint: str) -> Session:
    """As `join`, in a thread; who is cancelled meanwhile has left once this returns.

    Raises:
        OSError: where it cannot be opened.
    """
    joining = asyncio.ensure_future(asyncio.to_thread(join, endpoint))
    try:
        return await asyncio.shield(joining)
    except asyncio.CancelledError:
        with contextlib.suppress(OSError):
            await joining
            leave(endpoint)
        raise


def leave(endpoint: str) -> None:
    """Closes the session of an endpoint with the last who uses it."""
    with _lock:
        session = _sessions[endpoint]
        session.users -= 1
        if not session.users:
            del _sessions[endpoint]
            session.zenoh.close()


def _opened(endpoint: str) -> Any:  # noqa: ANN401 - an extra
    zenoh = library()
    config = zenoh.Config()
    if endpoint:
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", json.dumps([endpoint]))
        config.insert_json5("scouting/multicast/enabled", "false")
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise OSError(str(error).partition(" at /")[0].strip()) from error
