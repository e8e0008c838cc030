"""The set-up page: its form, the live process, what that measures, its raw logs; and what BlueOS asks a service.

What the live process measures comes from its own health page on the loopback address, and is passed on as it is.
"""

import asyncio
import dataclasses
import ipaddress
import json
import secrets
import shutil
from collections.abc import Callable, Sequence
from importlib import metadata, resources
from typing import Any

from pydantic import ValidationError

from bottomlock.config.validation import faults
from bottomlock.errors import BottomlockError
from bottomlock.live.health import page as health_page
from bottomlock.live.http_server import HTML, JSON, REQUEST_S, TEXT, HttpServer, Request, head, reply
from bottomlock.setup.folder import SetupFolder
from bottomlock.setup.form import FORM_AUTOPILOTS, FORM_INSTRUMENTS, SetupForm
from bottomlock.setup.process import LiveProcess

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
PORT = 8770
_LOOPBACK = ("127.0.0.1", "::1", "localhost")
_BLOCK = 65_536
_STALLED_S = 60.0
"""Longest time that a client takes nothing of a raw log."""
_PASSED_ON = ("/health", "/metrics", "/events")
"""What is asked of the live process."""
_STOPPED = {"state": "STOPPED", "why": "bottomlock live does not run"}
# A browser gives up for good at any other code; so it asks again, until the live process answers.
_AGAIN = reply(200, "text/event-stream", b"retry: 500\n\n")


def service() -> dict[str, Any]:
    """What BlueOS asks of a service, to show it in its menu: `/register_service`."""
    return {
        "name": "bottomlock",
        "description": "Navigates on whatever beams the DVL has left, and feeds the autopilot.",
        "icon": "mdi-compass-outline",
        "company": "bottomlock",
        "version": metadata.version("bottomlock"),
        "webpage": "https://github.com/bottomlock/bottomlock",
        "api": "",
        "new_page": False,
        "works_in_relative_paths": True,
    }


class SetupServer(HttpServer):
    """Serves the set-up page on the running loop.

    Args:
        folder: of the configuration.
        process: the live process.
        host, port, names, say: see `HttpServer`.
        networks: whose clients need no token.

    Beyond the loopback address the path begins with the token of the folder: who does not know it gets nothing (403).
    """

    methods = ("GET", "POST")
    advice = "start live-setup with --names NAME"

    def __init__(
        self,
        folder: SetupFolder,
        process: LiveProcess,
        host: str,
        port: int = PORT,
        *,
        names: Sequence[str] = (),
        networks: Sequence[Network] = (),
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        super().__init__(host, port, names=names, say=say)
        self._folder, self._process = folder, process
        self._networks = networks
        self.token = "" if host in _LOOPBACK else folder.token()

    def _path(self, request: Request) -> str | None:
        """The path behind the token, or, of a client that needs none, the whole; None where it is missing."""
        token, slash, path = request.path.removeprefix("/").partition("/")
        if self.token and secrets.compare_digest(token.encode(), self.token.encode()):
            return slash + path
        client = ipaddress.ip_address(request.client) if self.token else None
        is_free = client is None or any(client in network for network in self._networks)
        return request.path if is_free else None

    async def _answer(self, request: Request, writer: asyncio.StreamWriter) -> None:
        path = self._path(request)
        if path is None:
            why = b"the address is incomplete: live-setup says the whole one at its start\n"
            writer.write(reply(403, TEXT, why))
            return
        if not path:
            writer.write(head(308, TEXT, 0, f"Location: {self.token}/\r\n"))
            return
        request = dataclasses.replace(request, path=path)
        if request.method == "POST":
            writer.write(await self._post(request))
        elif request.path in _PASSED_ON:
            await self._pass_on(request.path, writer)
        elif request.path.startswith("/logs/"):
            await self._download(request.path.removeprefix("/logs/"), writer)
        else:
            try:
                writer.write(self._get(request.path))
            except OSError as error:
                words = f"{error.filename}: cannot be read ({error.strerror or error})\n"
                writer.write(reply(503, TEXT, words.encode()))

    def _get(self, path: str) -> bytes:
        if path == "/":
            return reply(200, HTML, (resources.files("bottomlock.setup") / "page.html").read_bytes())
        if path == "/state":
            return reply(200, HTML, health_page())
        if path == "/register_service":
            return _json(200, service())
        if path == "/setup":
            return _json(200, self._shown())
        return reply(404, TEXT, b"there are /, /state, /setup, /logs/NAME, /health, /metrics and /events\n")

    def _shown(self) -> dict[str, Any]:
        """Everything that the page shows beside what the live process measures."""
        folder = self._folder
        free = shutil.disk_usage(folder.folder).free if folder.folder.is_dir() else None
        return {
            "form": (folder.form() or SetupForm.model_construct()).model_dump(),
            "choices": {
                "instrument": {
                    name: {"title": one.title, "address": one.address}
                    for name, one in FORM_INSTRUMENTS.items()
                },
                "autopilot": {
                    name: {"title": one.title, "note": one.notes[0]} for name, one in FORM_AUTOPILOTS.items()
                },
            },
            "configuration": folder.text(),
            "by_hand": folder.by_hand(),
            "process": self._process.status(),
            "logs": [dataclasses.asdict(one) for one in folder.logs()],
            "free_bytes": free,
        }

    async def _post(self, request: Request) -> bytes:
        try:
            if request.path == "/save":
                return await self._save(request.body)
            if request.path in {"/start", "/stop"}:
                running = request.path == "/start"
                if running:
                    self._folder.settings()
                self._folder.shall_run = running
                self._process.want(running=running)
                return _json(200, {"faults": []})
        except BottomlockError as error:
            return _json(422, {"faults": [{"field": "", "words": line} for line in str(error).splitlines()]})
        return reply(404, TEXT, b"there are /save, /start and /stop\n")

    async def _save(self, body: bytes) -> bytes:
        try:
            content = json.loads(body)
        except (ValueError, RecursionError):
            return _json(422, {"faults": [{"field": "", "words": "the form is no JSON"}]})
        try:
            form = SetupForm.model_validate(content)
        except ValidationError as error:
            found = [
                {"field": fault.key.partition(".")[0], "words": str(fault)}
                for fault in faults(error, SetupForm)
            ]
            return _json(422, {"faults": found})
        self._folder.save(form)
        await self._process.restart()
        return _json(200, {"faults": []})

    async def _pass_on(self, path: str, writer: asyncio.StreamWriter) -> None:
        """The answer of the live process, as long as it comes; 503 where there is none."""
        try:
            health = self._folder.settings().health
            if health is None or not self._process.status()["running"]:
                raise ConnectionRefusedError
            async with asyncio.timeout(REQUEST_S):
                reader, asking = await asyncio.open_connection("127.0.0.1", health.port)
        except (OSError, BottomlockError):
            writer.write(_AGAIN if path == "/events" else _json(503, _STOPPED))
            return
        try:
            asking.write(f"GET {path} HTTP/1.1\r\n\r\n".encode())
            while block := await reader.read(_BLOCK):
                writer.write(block)
                async with asyncio.timeout(REQUEST_S):
                    await writer.drain()
        finally:
            asking.close()

    async def _download(self, name: str, writer: asyncio.StreamWriter) -> None:
        """A raw log, as long as it is now."""
        path = self._folder.log(name)
        if path is None:
            writer.write(reply(404, TEXT, b"there is no such raw log\n"))
            return
        with path.open("rb") as file:
            left = path.stat().st_size
            kind = f'Content-Disposition: attachment; filename="{name}"\r\n'
            writer.write(head(200, "application/octet-stream", left, kind))
            while left > 0 and (block := await asyncio.to_thread(file.read, min(left, _BLOCK))):
                left -= len(block)
                writer.write(block)
                async with asyncio.timeout(_STALLED_S):
                    await writer.drain()


def _json(code: int, content: dict[str, Any]) -> bytes:
    return reply(code, JSON, json.dumps(content).encode() + b"\n")
