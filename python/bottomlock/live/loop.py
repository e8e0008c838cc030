"""What sources, targets and pages share on the running loop: TCP servers, signals, tasks that end."""

import asyncio
import contextlib
import errno
import signal
import socket
from collections.abc import Awaitable, Callable
from typing import Any

PACE_S = 0.005
"""Least time between two connections that are accepted: ten thousand of them then take a few percent of the loop."""
RETRY_S = 1.0
"""Wait where the system has no descriptor or no memory for a further connection."""
BACKLOG = 64
"""Connections that the system holds until they are accepted."""
LIMIT_BYTES = 8192
"""Of what a client has sent and nobody has read yet, twice as much is held."""
_EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}


def words_of(error: BaseException) -> str:
    """An error in one line."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return text.splitlines()[0]


Talk = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


class TcpServer:
    """Talks with the clients that come, a task for each.

    Args:
        talk: what to do with a client; its connection is closed at the end.
        most: clients at a time.
        idle: whether a client may be sent away for a further one; by default none is, and the further one goes.
        say: is told when the system has no room for a connection.

    Attributes:
        clients: who is there, the longest first.
        sent_away: connections that were closed at once.
    """

    def __init__(
        self,
        talk: Talk,
        *,
        most: int,
        idle: Callable[[asyncio.StreamWriter], bool] = lambda _: False,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._talk, self._most, self._idle, self._say = talk, most, idle, say
        self.clients: dict[asyncio.StreamWriter, asyncio.Task[None]] = {}
        self.sent_away = 0

    async def run(self, host: str, port: int, opened: Callable[[int], None] = lambda _: None) -> None:
        """Listens on every address of a host until it is cancelled.

        Args:
            host, port: where; port 0 takes a free one, of the first address alone.
            opened: is given the port once it is open.

        Raises:
            OSError: where the address cannot be used.
        """
        servers = await _listen(host, port)
        opened(servers[0].getsockname()[1])
        try:
            await asyncio.gather(*map(self._accept, servers))
        finally:
            for server in servers:
                server.close()
            for task in list(self.clients.values()):
                await cancel(task)

    async def _accept(self, server: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                client, _ = await loop.sock_accept(server)
                await self._add(client)
            except OSError as error:
                # Anything else concerns the one client, which has gone.
                if error.errno in _EXHAUSTED:
                    self._say(f"no further connection: {error.strerror}")
                    await asyncio.sleep(RETRY_S)
                continue
            await asyncio.sleep(PACE_S)

    async def _add(self, client: socket.socket) -> None:
        if len(self.clients) >= self._most:
            idle = next(filter(self._idle, self.clients), None)
            if idle is None:
                client.close()
                self.sent_away += 1
                return
            idle.transport.abort()
            self.clients.pop(idle).cancel()
        reader, writer = await asyncio.open_connection(sock=client, limit=LIMIT_BYTES)
        self.clients[writer] = asyncio.create_task(self._until_its_end(reader, writer))

    async def _until_its_end(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):  # a client that went away
            try:
                await self._talk(reader, writer)
            finally:
                self.clients.pop(writer, None)
                writer.close()


async def _listen(host: str, port: int) -> list[socket.socket]:
    """Sockets that listen on every address of a host; of port 0 only the first, on a free port."""
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    places = list(dict.fromkeys((family, address) for family, _, _, _, address in found))
    servers: list[socket.socket] = []
    with contextlib.ExitStack() as opened:
        for family, address in places if port else places[:1]:
            server = socket.create_server(address, family=family, backlog=BACKLOG)
            server.setblocking(False)  # noqa: FBT003 - has no keyword
            servers.append(opened.enter_context(server))
        opened.pop_all()
    return servers


def cancel_at_signals() -> None:
    """Cancels this task at SIGINT and SIGTERM; not every system has such handlers."""
    task = asyncio.current_task()
    assert task is not None
    for name in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            asyncio.get_running_loop().add_signal_handler(name, task.cancel)


async def cancel(task: "asyncio.Task[Any]") -> None:
    """Ends a task and waits for its end."""
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task
