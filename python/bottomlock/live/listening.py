"""Connections of others: accepted one after another, no faster than the estimator can bear, within bounds."""

import asyncio
import errno
import socket
from collections.abc import Awaitable, Callable

PACE_S = 0.005
"""Least time between two connections that are accepted: ten thousand of them then take a few percent of the loop."""
RETRY_S = 1.0
"""Wait where the system has no descriptor or no memory for a further connection."""
BACKLOG = 64
"""Connections that the system holds until they are accepted."""
_EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}


async def listen(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen on every address of a host; of port 0 only the first, on a free port.

    Raises:
        OSError: where the address cannot be used.
    """
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    places = list(dict.fromkeys((family, address) for family, _, _, _, address in found))
    sockets: list[socket.socket] = []
    try:
        for family, address in places if port else places[:1]:
            one = socket.socket(family, socket.SOCK_STREAM)
            sockets.append(one)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                one.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            one.setblocking(False)  # noqa: FBT003 - has no keyword
            one.bind(address)
            one.listen(BACKLOG)
    except OSError:
        for one in sockets:
            one.close()
        raise
    return sockets


async def accept(
    server: socket.socket, take: Callable[[socket.socket], Awaitable[None]], say: Callable[[str], None]
) -> None:
    """Accepts connections until it is cancelled.

    Args:
        server: listens; not blocking.
        take: is given each connection, not blocking, and answers for it.
        say: is told when the system has no room for a connection.
    """
    loop = asyncio.get_running_loop()
    while True:
        try:
            client, _ = await loop.sock_accept(server)
        except OSError as error:
            # Anything else concerns the one client, which has gone.
            if error.errno in _EXHAUSTED:
                say(f"no further connection: {error.strerror}")
                await asyncio.sleep(RETRY_S)
            continue
        await take(client)
        await asyncio.sleep(PACE_S)
