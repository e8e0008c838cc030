"""The command `bottomlock simulate-dvl`: a simulated instrument that sends a maker's bytes."""

from __future__ import annotations

import asyncio
import datetime as dt
import math
import sys
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, say
from bottomlock.cli.parameters import check_ending, check_option
from bottomlock.encoders.registry import FORMATS, NAMES
from bottomlock.errors import EXIT_INTERRUPTED, ScenarioError

if TYPE_CHECKING:
    from bottomlock.instruments.play import Channel
    from bottomlock.instruments.readings import Readings
    from bottomlock.instruments.schedule import Record

DEFAULT_START = "2026-01-01T00:00:00"


def simulate_dvl(
    source: str,
    *,
    format: Annotated[  # noqa: A002 - the option's name
        str, Parameter(help=f"Maker's format: {', '.join(NAMES)}.")
    ] = FORMATS[0].name,
    dvl: Annotated[
        str,
        Parameter(
            help="Where the DVL sends: tcpin:HOST:PORT (listens), udpout:HOST:PORT (sends), "
            "serial:DEVICE:BAUD, file:PATH."
        ),
    ] = "tcpin:16171",
    imu: str | None = None,
    depth: str | None = None,
    speed: str = "1",
    run: int = 0,
    seed: int | None = None,
    duration_s: float | None = None,
    faults: str | None = None,
    truth: Path | None = None,
    geometry: str | None = None,
    clock: str = DEFAULT_START,
    latency_ms: float = 10.0,
    altitude_m: float = 20.0,
    wait: Annotated[bool, Parameter(negative="--no-wait")] = True,
    force: Force = False,
) -> None:
    """Simulate a DVL that sends a maker's bytes over TCP, UDP, a serial line or a file.

    IMU and depth sensor send lines beside it, on the same clock.

    Args:
        source: Packaged scenario or TOML file; a replay case; a beam table (.parquet) or a raw DVL log.
        imu: Where the IMU sends lines time_ns,wx,wy,wz,fx,fy,fz; off by default.
        depth: Where the depth sensor sends lines time_ns,depth; off by default.
        speed: Seconds of the run per second, or max.
        run: Number of the scenario's run: its drawn sensor errors.
        seed: Seed of sensor errors and faults; the scenario's own by default.
        duration_s: End after so many seconds of the run.
        faults: Fractions of the pings:
            drops=0.05,duplicates=0.02,stale=0.02,half_lines=0.01,clock_steps=0.001,reconnects=0.001; clock_step_s=1.
        truth: Parquet file for what was sent, with truth and faults.
        geometry: Packaged geometry or TOML file; the scenario's or log's own by default.
        clock: Time of the first reading on the instruments' clock: a date (UTC), now, or run for the run's own.
        latency_ms: Time from the last echo to the sending.
        altitude_m: Over the bottom, where the source has no ranges.
        wait: Start when every TCP server has a client; --no-wait starts at once.
    """
    from bottomlock.encoders.registry import encoder, format_named
    from bottomlock.files.atomic_write import write_parquet
    from bottomlock.instruments.faults import parse_faults
    from bottomlock.instruments.play import Channel, parse_address, sink_of
    from bottomlock.instruments.schedule import POWERED_S, depth_lines, imu_lines, records, sent_table

    settings = parse_faults(faults)
    pace = _pace(speed)
    _check(run=run, latency_ms=latency_ms, altitude_m=altitude_m, duration_s=duration_s)
    format_named(format)
    channels = {"dvl": dvl, "imu": imu, "depth": depth}
    addresses = {
        name: parse_address(text, f"--{name}") for name, text in channels.items() if text is not None
    }
    if truth is not None:
        check_ending(truth, ".parquet")
    written = [] if truth is None else [truth]
    written += [Path(address.path) for address in addresses.values() if address.kind == "file"]
    readings, own_seed = _readings(
        source, geometry, run=run, seed=seed, altitude_m=altitude_m, out=written, force=force
    )
    if duration_s is not None:
        readings = readings.first_seconds(duration_s)
    shift = _shift(clock, readings)
    latency_ns = round(latency_ms * 1e6)

    def dvl_records(offset_ns: int) -> Iterator[Record]:
        powered_ns = readings.first_ns + offset_ns - round(POWERED_S * 1e9)
        writer = encoder(format, readings.geometry, start_ns=powered_ns)
        return records(readings, writer, settings, seed=own_seed, latency_ns=latency_ns, offset_ns=offset_ns)

    encoder(format, readings.geometry)
    makers: dict[str, Callable[[int], Iterator[Record]]] = {"dvl": dvl_records}
    if imu is not None:
        if (inertial := readings.imu) is None:
            raise _absent("imu", readings)
        makers["imu"] = lambda offset_ns: imu_lines(inertial, offset_ns=offset_ns)
    if depth is not None:
        if (depths := readings.depth) is None:
            raise _absent("depth", readings)
        makers["depth"] = lambda offset_ns: depth_lines(depths, offset_ns=offset_ns)
    commands = format_named(format).commands

    answering = {} if commands is None else {"dvl": commands().client}
    parts = [
        Channel(name, sink_of(addresses[name], answering.get(name), force=force), maker)
        for name, maker in makers.items()
    ]
    tally = _Tally(keep=truth is not None)
    try:
        asyncio.run(_run(parts, tally, pace=pace, shift=shift, wait=wait, format_name=format))
    finally:
        if truth is not None and tally.records:
            write_parquet(truth, sent_table(readings, tally.records))
        if tally.pings:
            console.print(tally.text, highlight=False)


@dataclass
class _Tally:
    """Counts of what the DVL sent; the records themselves only where they are wanted."""

    keep: bool
    pings: int = 0
    faulty: int = 0
    size: int = 0
    records: list[Record] = field(default_factory=list)

    def add(self, record: Record) -> None:
        self.pings += 1
        self.faulty += bool(record.faults)
        self.size += len(record.data)
        if self.keep:
            self.records.append(record)

    @property
    def text(self) -> str:
        return f"{self.pings} pings, {self.faulty} with faults, {self.size} bytes of the DVL"


async def _run(
    parts: list[Channel],
    tally: _Tally,
    *,
    pace: float | None,
    shift: Callable[[], int],
    wait: bool,
    format_name: str,
) -> None:
    from bottomlock.instruments.play import play
    from bottomlock.live.loop import cancel_at_signals

    def opened() -> None:
        for part in parts:
            what = format_name if part.name == "dvl" else "lines"
            say(f"{part.name}: {what} on {part.sink.where}")
        if wait and any(part.is_server for part in parts):
            say("starts once every TCP server has a client (--no-wait: at once)")
        console.file.flush()

    def sent(part: Channel, record: Record) -> None:
        if part.name == "dvl":
            tally.add(record)

    cancel_at_signals()
    try:
        await play(parts, speed=pace, opened=opened, offset_ns=shift, sent=sent, wait=wait)
    except asyncio.CancelledError:
        sys.exit(EXIT_INTERRUPTED)


def _pace(text: str) -> float | None:
    """Seconds of the run per second; None for as fast as possible."""
    if text == "max":
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise ScenarioError(f"is '{text}'", key="--speed", expected="a number above 0, or max")
    return value


def _check(*, run: int, latency_ms: float, altitude_m: float, duration_s: float | None) -> None:
    check_option("--run", run, "a run number, 0 to 4294967295", holds=0 <= run < 2**32)
    check_option("--latency-ms", f"{latency_ms:g}", "0 to 10000 ms", holds=0.0 <= latency_ms <= 10_000.0)
    check_option("--altitude-m", f"{altitude_m:g}", "above 0, to 10000 m", holds=0.0 < altitude_m <= 10_000.0)
    check_option("--duration-s", duration_s, "seconds above 0", holds=0.0 < (duration_s or 1.0) < math.inf)


def _absent(option: str, readings: Readings) -> ScenarioError:
    return ScenarioError(f"{readings.name} has no readings of this sensor", place=f"--{option}")


def _is_case(path: Path) -> bool:
    """Whether a TOML file is a replay case."""
    from bottomlock.config.toml_file import kinds_of

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return "replay case" in kinds_of(content)


def _readings(
    source: str,
    geometry: str | None,
    *,
    run: int,
    seed: int | None,
    altitude_m: float,
    out: Sequence[Path],
    force: bool,
) -> tuple[Readings, int]:
    """The readings of any source, and the seed of the faults; first, that nothing to write is read."""
    from bottomlock.config.scenario import load_scenario
    from bottomlock.files.overwriting import check_free
    from bottomlock.instruments.sources import (
        readings_of_case,
        readings_of_log,
        readings_of_scenario,
        with_geometry,
    )
    from bottomlock.replay.case import load_case

    path = Path(source)
    named = [path, *([] if geometry is None else [Path(geometry)])]
    if path.suffix.lower() == ".toml" and _is_case(path):
        case = load_case(path)
        check_free(*out, inputs=[*named, Path(case.dvl.geometry), *case.files().values()], force=force)
        if geometry is not None:
            raise ScenarioError(f"{path} is a replay case and names its own geometry", place="--geometry")
        return readings_of_case(path, altitude_m=altitude_m), seed or 0
    if path.suffix.lower() not in {"", ".toml"}:
        check_free(*out, inputs=named, force=force)
        return readings_of_log(path, geometry=geometry, altitude_m=altitude_m), seed or 0
    scenario = load_scenario(source).with_overrides(seed=seed)
    check_free(*out, inputs=[*named, *scenario.files()], force=force)
    if geometry is not None:
        scenario = with_geometry(scenario, geometry)
    return readings_of_scenario(scenario, run=run, altitude_m=altitude_m), scenario.campaign.seed


def _shift(clock: str, readings: Readings) -> Callable[[], int]:
    """What is added to the times of the run, found when the sending starts."""
    if clock == "run":
        return lambda: 0
    if clock == "now":
        return lambda: time.time_ns() - readings.first_ns
    try:
        when = dt.datetime.fromisoformat(clock)
    except ValueError as error:
        raise ScenarioError(
            f"is '{clock}'", key="--clock", expected=f"a date as {DEFAULT_START}, or now, or run"
        ) from error
    utc = when if when.tzinfo is not None else when.replace(tzinfo=dt.UTC)
    offset_ns = (utc - dt.datetime(1970, 1, 1, tzinfo=dt.UTC)) // dt.timedelta(microseconds=1) * 1000
    return lambda: offset_ns - readings.first_ns
