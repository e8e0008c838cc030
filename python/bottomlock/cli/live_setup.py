"""The command `bottomlock live-setup`: the set-up page, and the live process that it starts and stops."""

from __future__ import annotations

import asyncio
import ipaddress
from pathlib import Path
from typing import TYPE_CHECKING

from bottomlock.cli.console import errors
from bottomlock.cli.parameters import check_option
from bottomlock.errors import BottomlockError, OutputError, ScenarioError

if TYPE_CHECKING:
    from bottomlock.setup.folder import SetupFolder
    from bottomlock.setup.process import LiveProcess
    from bottomlock.setup.server import SetupServer


def live_setup(
    folder: Path,
    *,
    host: str = "127.0.0.1",
    port: int = 8770,
    names: tuple[str, ...] = (),
    networks: tuple[str, ...] = (),
) -> None:
    """Set live navigation up in a browser: instrument, autopilot, mounting; start, stop, state, raw logs.

    Args:
        folder: Of the configuration (live.toml), its raw logs and checkpoint; made where it is missing.
        host: Address of the page; "0.0.0.0" lets who knows the address that is printed, with its token, set it up.
        port: TCP port of the page; 0: a free one.
        names: Names under which the page may be asked beside addresses; .END: all that end so.
        networks: Networks, as 192.168.2.0/24, whose clients need no token.
    """
    from bottomlock.ports.address import checked_host
    from bottomlock.setup.folder import SetupFolder
    from bottomlock.setup.process import LiveProcess
    from bottomlock.setup.server import SetupServer

    check_option("--port", port, "0 to 65535", holds=0 <= port <= 65_535)
    if folder.exists() and not folder.is_dir():
        raise ScenarioError("is a file", place=folder, expected="a folder, or one that is to be made")
    kept = SetupFolder(folder)
    process = LiveProcess(kept.config, _say)
    try:
        known = [ipaddress.ip_network(network) for network in networks]
    except ValueError as error:
        raise ScenarioError(error, key="--networks", expected="networks as 192.168.2.0/24") from error
    try:
        checked_host(host)
    except ValueError as error:
        raise ScenarioError(error, key="--host") from error
    server = SetupServer(kept, process, host, port, names=names, networks=known, say=_say)
    asyncio.run(_serve(kept, process, server))


def _say(text: str) -> None:
    errors.print(text, markup=False, highlight=False, soft_wrap=True)


def _go_on(kept: SetupFolder, process: LiveProcess) -> None:
    """Starts the live process that was running before, if its configuration may be run by the page."""
    if not kept.shall_run:
        return
    try:
        kept.settings()
    except BottomlockError as error:
        _say(f"bottomlock: not started: {error}")
        return
    process.want(running=True)


async def _serve(kept: SetupFolder, process: LiveProcess, server: SetupServer) -> None:
    from bottomlock.live.loop import cancel, cancel_at_signals

    def opened() -> None:
        address = f"{server.url}{server.token}/" if server.token else server.url
        _say(f"bottomlock: set-up page {address}, configuration in {kept.folder}")
        _go_on(kept, process)

    cancel_at_signals()
    living = asyncio.create_task(process.run())
    try:
        await server.run(opened)
    except asyncio.CancelledError:
        pass
    except OSError as error:
        raise OutputError(f"no set-up page on {server.place}: {error.strerror or error}") from error
    finally:
        await cancel(living)
