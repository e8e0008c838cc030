"""The command `bottomlock live-setup`: the set-up page, and the live process that it starts and stops."""

import asyncio
from pathlib import Path

from bottomlock.cli.console import errors
from bottomlock.errors import BottomlockError, OutputError
from bottomlock.live.connections import cancel, cancel_at_signals
from bottomlock.setup.folder import SetupFolder
from bottomlock.setup.process import LiveProcess
from bottomlock.setup.server import PORT, SetupServer


def live_setup(
    folder: Path, *, host: str = "127.0.0.1", port: int = PORT, names: tuple[str, ...] | None = None
) -> None:
    """Set live navigation up in a browser: instrument, autopilot, mounting; start, stop, state, raw logs.

    Args:
        folder: Of the configuration (live.toml), its raw logs and checkpoint; made where it is missing.
        host: Address of the page; "0.0.0.0" lets the whole network set it up.
        port: TCP port of the page; 0: a free one.
        names: Names under which the page may be asked; .END: all that end so. Default beyond loopback: .local.
    """
    asyncio.run(_serve(folder, host, port, names))


def _say(words: str) -> None:
    errors.print(words, markup=False, highlight=False, soft_wrap=True)


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


async def _serve(folder: Path, host: str, port: int, names: tuple[str, ...] | None) -> None:
    kept = SetupFolder(folder)
    process = LiveProcess(kept.config, _say)
    server = SetupServer(kept, process, host, port, names=names, say=_say)

    def opened() -> None:
        _say(f"bottomlock: set-up page {server.url}, configuration in {kept.folder}")
        _go_on(kept, process)

    cancel_at_signals()
    living = asyncio.create_task(process.run())
    try:
        await server.run(opened)
    except asyncio.CancelledError:
        pass
    except OSError as error:
        raise OutputError(f"no set-up page on {host}:{port}: {error.strerror or error}") from error
    finally:
        await cancel(living)
