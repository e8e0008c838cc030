"""The command `bottomlock live`: from the DVL's bytes to those of an autopilot, in one process."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from bottomlock.cli.common import Force
from bottomlock.cli.console import EXIT_DEPARTURE, errors, note, say
from bottomlock.errors import DataError, ScenarioError
from bottomlock.live.templates import AUTOPILOTS, INSTRUMENTS

if TYPE_CHECKING:
    from bottomlock.live.config import LiveConfig
    from bottomlock.live.engine import Engine, Message
    from bottomlock.live.replay import Replayed
    from bottomlock.live.runner import Live, Say


def live(
    config: Path,
    *,
    init: Annotated[
        str | None, Parameter(help=f"Write a commented CONFIG for an instrument: {', '.join(INSTRUMENTS)}.")
    ] = None,
    autopilot: Annotated[str, Parameter(help=f"Receiver of --init: {', '.join(AUTOPILOTS)}.")] = "text",
    dry_run: bool = False,
    replay: Path | None = None,
    export: str | None = None,
    force: Force = False,
) -> None:
    """Navigate live: from DVL, IMU and depth to the ports of an autopilot.

    Args:
        config: TOML file; docs/live.md describes it. With --init, the file to write.
        dry_run: Show what would be sent, and send nothing; ends where no ping comes within 30 s.
        replay: Play a raw log again, and compare with what was sent; exit code 1 where it differs.
        export: With --replay: formats of the log's track, written to the folder NAME_export beside the log, separated
            by commas: kml, geojson, csv, tum, mcap.
    """
    from bottomlock.files.overwriting import check_apart
    from bottomlock.live.config import cautions, load_config
    from bottomlock.live.replay import replay_log
    from bottomlock.live.runner import Live, begin, host_clock

    if export is not None and replay is None:
        raise ScenarioError("is given without --replay LOG: it writes the track of a raw log", key="--export")
    if init is not None:
        _init(config, init, autopilot, force=force)
        return
    settings = load_config(config)
    check_apart(*_files(config, settings))
    if replay is not None and export is not None:
        _export(config, settings, replay, export, force=force)
        return
    if replay is not None:
        _say_replayed(replay_log(settings, replay))
        return
    if not settings.port and not dry_run:
        raise ScenarioError(
            "there is no [[port]], so nothing would be sent", place=config, hint="--dry-run needs none"
        )
    _check_without_ros(config, settings)
    for caution in cautions(settings):
        note(caution)
    clock = host_clock()
    engine, log = begin(settings, config.read_bytes(), say=note, clock=clock, logged=not dry_run)
    send = _shown(settings, engine) if dry_run else None
    _run(
        Live(settings, engine, say=note, log=log, send=send, clock=clock),
        patience_s=PATIENCE_S if dry_run else None,
    )


def _check_without_ros(config: Path, settings: LiveConfig) -> None:
    """Raises for what only the ROS 2 node can open."""
    named = [source.address for source in settings.source] + [port.to for port in settings.port]
    named += [] if settings.diagnostics is None else [settings.diagnostics.to]
    topic = next((address for address in named if address.startswith("ros:")), None)
    if topic is not None:
        raise ScenarioError(
            "is a topic of ROS 2",
            place=config,
            key=f"'{topic}'",
            expected="an address that a process without ROS can open",
            hint="run the node ros/bottomlock_ros with this file (docs/howto/ros2.md)",
        )


def _files(config: Path, settings: LiveConfig) -> tuple[list[Path], list[Path]]:
    """The files that are written, and those that are read."""
    written = [Path(port.to.removeprefix("file:")) for port in settings.port if port.to.startswith("file:")]
    written += [] if settings.checkpoint is None else [Path(settings.checkpoint.file)]
    return written, [config, Path(settings.dvl.geometry)]


def _init(config: Path, instrument: str, autopilot: str, *, force: bool) -> None:
    """Writes a configuration."""
    from bottomlock.files.atomic_write import write_text
    from bottomlock.files.overwriting import check_free
    from bottomlock.live.templates import template

    text = template(instrument, autopilot)
    check_free(config, force=force)
    write_text(config, text)
    say(f"wrote {config}; edit it, then: bottomlock live --dry-run {config}")


def _shown(settings: LiveConfig, engine: Engine) -> Callable[[Message], None]:
    """Prints a message in place of sending it."""

    def show(message: Message) -> None:
        section = settings.port[message.port]
        text = message.data.rstrip(b"\r\n").decode("ascii", "replace")
        content = text if text.isprintable() else f"{len(message.data)} bytes {message.data.hex(' ')}"
        say(f"{engine.state} {section.port} to {section.to}: {content}")

    return show


PATIENCE_S = 30.0
"""Time that a dry run waits for its first ping."""


async def _pinged(running: Live, patience_s: float | None) -> None:
    """Runs to the end; in a dry run only where a ping comes in time.

    Raises:
        DataError: where none does, with what each source does.
    """
    from bottomlock.live.loop import cancel
    from bottomlock.live.sections import DVL_FORMATS

    pings = next(source for source in running.engine.sources if source.section.format in DVL_FORMATS)
    task = asyncio.create_task(running.run())
    try:
        async with asyncio.timeout(patience_s):
            # The engine has no event.
            while patience_s is not None and not (pings.used or task.done()):  # noqa: ASYNC110
                await asyncio.sleep(0.1)
    except TimeoutError:
        states = zip(running.config.source, running.sources, strict=True)
        raise DataError(
            f"no ping of source '{pings.section.name}' within {patience_s:g} s: "
            + ", ".join(f"{section.name} {connection.state}" for section, connection in states)
        ) from None
    else:
        await task
    finally:
        await cancel(task)


def _run(running: Live, *, patience_s: float | None = None) -> None:
    from bottomlock.live.health import status
    from bottomlock.live.loop import cancel_at_signals

    async def until_stopped() -> None:
        cancel_at_signals()
        others = [asyncio.create_task(serve_page(running, note))]
        if sys.stderr.isatty() and running.sinks:
            from bottomlock.cli.live_view import show  # a restart without a terminal is sooner without it

            others.append(asyncio.create_task(show(lambda: status(running), errors)))
        with contextlib.suppress(asyncio.CancelledError):
            await _pinged(running, patience_s)
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    # What the start has made stays: the collector need not look at it while a ping waits.
    gc.freeze()
    asyncio.run(until_stopped())
    for port in running.engine.ports:
        last = f"; last silent because {port.silent_because}" if port.silent_because else ""
        note(f"port {port.name}: {port.sent} messages{last}")


async def serve_page(running: Live, say: Say) -> None:
    """Serves the health page, and says where; navigation goes on where that is not possible."""
    from bottomlock.live.health import HealthServer, status

    section = running.config.health
    if section is None:
        return
    server = HealthServer(
        lambda: status(running),
        section.host,
        section.port,
        names=section.names,
        say=lambda text: say(f"health page: {text}"),
    )
    try:
        await server.run(lambda: say(f"health page {server.url}"))
    except OSError as error:
        say(f"no health page on {section.host}:{section.port}: {error.strerror or error}")


def _export(config: Path, settings: LiveConfig, log: Path, formats: str, *, force: bool) -> None:
    """Exports a raw log, names the files, and says what its replay gave."""
    try:
        from bottomlock.cli.parameters import split
        from bottomlock.export.live import export_live
    except ModuleNotFoundError as error:
        raise DataError(
            f"needs {error.name}, which an install for a vehicle leaves out",
            key="--export",
            hint=f"copy {log} and {config} to a computer with all of bottomlock",
        ) from error
    inputs = [config, Path(settings.dvl.geometry)]
    replayed, files = export_live(settings, log, split(formats) or (), inputs=inputs, force=force)
    for path in files:
        say(f"wrote {path}")
    _say_replayed(replayed)


def _say_replayed(replayed: Replayed) -> None:
    """Says what a replay gave; ends with exit code 1 where it differs from what was sent, or the log is damaged."""
    say(replayed.text())
    if replayed.first_difference or replayed.damaged:
        sys.exit(EXIT_DEPARTURE)
