"""HTTP on the running loop for a few people who watch a vehicle: one request a connection, within bounds.

Who is asked: a page of the web whose name was pointed at this address asks under its own name, and gets nothing (421).
Who asks: a page of the web can make a browser send a request, though it cannot read the answer. What changes anything
is therefore a POST with `Content-Type: application/json`: before that a browser asks for leave, which is not given.
"""

import asyncio
import ipaddress
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from http import HTTPStatus

from bottomlock.live.loop import TcpServer

HTML, JSON, TEXT = "text/html; charset=utf-8", "application/json", "text/plain"
REQUEST_S = 5.0
"""Longest time that a request, and a client that does not read, is waited for."""
_BODY_BYTES = 65_536
_CLIENTS = 32
"""Most connections at a time."""


@dataclass(frozen=True)
class Request:
    """A request: "GET" or "POST", path without query, headers by names in small letters, body, client's address."""

    method: str
    path: str
    headers: Mapping[str, str]
    body: bytes = b""
    client: str = ""


class HttpServer:
    """Serves on the running loop; `_answer` writes what is asked for.

    Args:
        host, port: where; port 0 takes a free one.
        names: host names under which it may be asked, beside addresses, localhost and `host`. One with a dot before it
            stands for every name that ends so. A page of the web whose name was pointed at this address asks under its
            own name, and gets nothing.
        say: is told when the system has no room for a client.
    """

    methods: tuple[str, ...] = ("GET",)
    """What may be asked; POST is with a body in JSON."""
    advice = "list it in health.names"
    """What to do where another name is a good one."""

    def __init__(
        self, host: str, port: int, *, names: Sequence[str] = (), say: Callable[[str], None] = lambda _: None
    ) -> None:
        self._host, self._port = host, port
        lower = [name.lower() for name in names]
        self._names = {"localhost", host.lower(), *(name for name in lower if not name.startswith("."))}
        self._endings = tuple(name for name in lower if name.startswith("."))
        self._asked: set[asyncio.StreamWriter] = set()
        # A further client takes the place of the one that has asked nothing for longest.
        self._server = TcpServer(
            self._talk, most=_CLIENTS, idle=lambda client: client not in self._asked, say=say
        )
        self.url, self.place = "", f"{host}:{port}"

    async def run(self, opened: Callable[[], None] = lambda: None) -> None:
        """Serves until it is cancelled; `opened` is called once `url` is known.

        Raises:
            OSError: where the address cannot be used.
        """

        def listening(port: int) -> None:
            host = f"[{self._host}]" if ":" in self._host else self._host
            self.url = f"http://{host}:{port}/"
            opened()

        await self._server.run(self._host, self._port, listening)

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            async with asyncio.timeout(REQUEST_S):
                request = await self._request(reader)
            self._asked.add(writer)
            client = writer.get_extra_info("peername")
            if client is None:
                return  # it went away before it was accepted
            if isinstance(request, bytes):
                writer.write(request)
            else:
                await self._answer(replace(request, client=client[0]), writer)
            await writer.drain()
        except (asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass  # a client that never asked anything
        finally:
            self._asked.discard(writer)

    async def _request(self, reader: asyncio.StreamReader) -> Request | bytes:
        """A request that may be answered, or the answer to one that may not."""
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        first, *lines = head.split("\r\n")
        pairs = [(name.lower(), value.strip()) for name, _, value in (line.partition(":") for line in lines)]
        headers = dict(pairs)
        words = first.split(" ")
        if sum(name == "host" for name, _ in pairs) > 1 or not self._is_ours(headers.get("host")):
            why = f"asked under another name than localhost or an address: {self.advice}\n"
            return reply(421, TEXT, why.encode())
        if len(words) < 2 or words[0] not in self.methods:
            return reply(405, TEXT, f"only {' and '.join(self.methods)}\n".encode())
        request = Request(words[0], words[1].partition("?")[0], headers)
        return await self._with_body(request, reader) if words[0] == "POST" else request

    async def _with_body(self, request: Request, reader: asyncio.StreamReader) -> Request | bytes:
        headers = request.headers
        if headers.get("content-type", "").partition(";")[0].strip().lower() != JSON:
            return reply(415, TEXT, b"a POST must have Content-Type: application/json\n")
        origin = headers.get("origin")
        if origin is not None and not self._is_ours(origin.partition("://")[2]):
            return reply(403, TEXT, b"asked by a page of another host\n")
        length = headers.get("content-length", "")
        if not (length.isascii() and length.isdigit()):
            return reply(411, TEXT, b"a POST must have a Content-Length\n")
        if len(length) > len(str(_BODY_BYTES)) or int(length) > _BODY_BYTES:
            return reply(413, TEXT, f"expected {_BODY_BYTES} bytes at most\n".encode())
        return Request(request.method, request.path, headers, await reader.readexactly(int(length)))

    def _is_ours(self, host: str | None) -> bool:
        """Whether a host is this one; a request without one comes from no browser."""
        if host is None:
            return True
        name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
        name = name.lower().rstrip(".")
        if name in self._names or name.endswith(self._endings):
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    async def _answer(self, request: Request, writer: asyncio.StreamWriter) -> None:
        """Writes the answer to a request."""
        raise NotImplementedError


def head(code: int, kind: str, length: int, more: str = "") -> bytes:
    """The head of an answer with `length` bytes; `more` headers, each with its end of line."""
    return (
        f"HTTP/1.1 {code} {HTTPStatus(code).phrase}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n"
        "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n"
        "Content-Security-Policy: default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
        f"connect-src 'self'\r\n{more}Connection: close\r\n\r\n"
    ).encode()


def reply(code: int, kind: str, body: bytes) -> bytes:
    """A whole answer."""
    return head(code, kind, len(body)) + body
