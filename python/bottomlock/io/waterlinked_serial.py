"""Water Linked DVLs on a serial line: `wrz` (velocity) with four `wru` (transducers), each with its CRC-8.

The instrument sends a `wrz` and then its transducers in order, so a `wru` belongs to the `wrz` before it unless a line
between them was damaged or lost. In water tracking (version 2.7) a `wrs` stands in place of the `wrz`: it is a ping
whose beams have no bottom, and a cell of the water. The deprecated `wrx` is a velocity too; `wrt` holds distances
alone, so logs of `wrx` and `wrt` have no beam velocities.
"""

import re
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Flags, Floats, Integers, Recording
from bottomlock.io.framing import Stream, WaterLinkedLines
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, make_water, raise_if_empty, whole_times
from bottomlock.io.water_table import WaterTable
from bottomlock.io.waterlinked_json import WATER_RANGE_M
from bottomlock.io.waterlinked_sentences import (
    LOST,
    TRANSDUCER,
    VELOCITY,
    VELOCITY_ALONE,
    WATER,
    Events,
    read_events,
)

NAME = "waterlinked-serial"
STREAM = Stream(
    WaterLinkedLines,
    transmission=re.compile(
        rb"wr(?:z,[^,*\n]{0,200}|s)(?:,[^,*\n]{0,200}){8},([0-9]{1,18}),[^,*\n]{1,32},[^,*\n]{1,8}\*"
    ),
    sums=True,
    lost=True,
)
_BEAMS = 4
_MISSING = 1.5
"""Intervals between two reports from which on one is missing between them."""
ADVICE = (
    "the log has velocities but no beams (wru): update the instrument's firmware to 2.1 or later, "
    "or record its TCP port 16171"
)


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return re.search(rb"(^|[\s\x00,])wr[zuxtps],-?\d", head) is not None


@dataclass(frozen=True, eq=False)
class _Pings:
    """Velocity reports with the transducers that follow them; `lines` are those up to the next velocity report.

    Attributes:
        position: (n,) line of each report.
        velocity: (n, 6) x, y, z, altitude, figure of merit, interval (ms).
        verdict: (n,) 1 and 0 as the instrument flags its velocity.
        validity_us: (n,) time of validity, None where there is none.
        lines: (n,).
        water: (n,) the report is one of the water.
        joined: (n, 4) the transducer's report is there.
        beams: (n, 4, 4) by transducer: velocity, distance, rssi, nsd.
    """

    position: Integers
    velocity: Floats
    verdict: Integers
    validity_us: list[int | None]
    lines: Integers
    water: Flags
    joined: Flags
    beams: Floats


def _join(events: Events, data: bytes, account: Account) -> _Pings:
    """Joins transducer reports to the velocity report before them.

    The reports carry no number of their ping. The instrument sends a `wrz` and then `wru` 0, 1, 2, 3, so whatever
    departs from that closes the ping: a line that cannot be read may have been the next `wrz`, and a missing number
    shows a lost line.
    """
    kind = events.kind
    with_beams = (kind == VELOCITY) | (kind == WATER)
    opens = with_beams | (kind == VELOCITY_ALONE)
    report = np.flatnonzero(opens)
    ping = np.cumsum(opens) - 1
    # The report before each event; without any, the event itself.
    before = np.where(ping >= 0, report[ping] if len(report) else 0, np.arange(len(kind)))
    transducer = kind == TRANSDUCER
    inside = transducer & (ping >= 0) & with_beams[before]
    fits = inside & (events.flag == np.arange(len(kind)) - before - 1)
    fits &= _unbroken(fits | opens, events.lost, before)
    for k in np.flatnonzero(fits & (events.framed | events.framed[before])).tolist():
        fits[k] = events.same_frame(data, k, int(before[k]))
    open_ = inside & _unbroken(fits | opens, events.lost, before)
    fits &= open_
    for reason, those in (
        ("transducer report before any velocity", ping < 0),
        ("transducer report after a lost line", (ping >= 0) & ~open_),
        ("transducer report without its velocity report", open_ & ~fits),
    ):
        account.skip_where(reason, transducer & those, events.position)
    account.pass_by_where("wru (joined to its wrz or wrs)", fits, events.position)
    # The lines of each ping that are there: those that count, and those that cannot be read.
    there = (transducer | (kind == LOST)) + events.lost[1:]
    lines = 1 + np.bincount(ping[ping >= 0], there[ping >= 0], minlength=len(report)).astype(np.int64)
    joined = np.zeros((len(report), _BEAMS), dtype=bool)
    beams = np.full((len(report), _BEAMS, 4), np.nan)
    joined[ping[fits], events.flag[fits]] = True
    beams[ping[fits], events.flag[fits]] = events.numbers[fits, :4]
    return _Pings(
        position=events.position[report],
        velocity=events.numbers[report],
        verdict=events.flag[report],
        validity_us=events.validity_us,
        lines=lines,
        water=kind[report] == WATER,
        joined=joined,
        beams=beams,
    )


def _unbroken(good: Flags, lost: Integers, before: Integers) -> Flags:
    """(n,) every event from the report before it up to, but not with, this one is good, and none between is lost."""
    bad, gaps = np.cumsum(~good), np.cumsum(lost[:-1] > 0)
    return np.asarray((bad - ~good == bad[before]) & (gaps == gaps[before]), dtype=bool)


def _clear_unsure(pings: _Pings, account: Account) -> None:
    """Takes the transducers from pings after which lines are missing without a trace.

    Of two reports in the log the second states its interval to the report before it. Where their times of validity lie
    further apart, a report is missing between them. If its lines are there, damaged, it closed the ping. If they are
    not, the transducers may be those of the missing report.
    """
    validity = np.array([NAN if t is None else float(t) for t in pings.validity_us])
    interval = pings.velocity[1:, 5]
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        intervals = np.diff(validity) / (1000.0 * interval)
    missing = (interval > 0.0) & pings.joined[:-1].any(axis=1) & (intervals > _MISSING)
    missing &= pings.lines[:-1] < (_BEAMS + 1) * np.maximum(2.0, np.rint(intervals))
    reason = "lines missing after this report: its transducers may be another's"
    account.flag_where(reason, missing, pings.position[:-1])
    pings.joined[:-1][missing] = False


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Velocity reports with their transducers.

    Raises:
        DataError: where there is no velocity report, or none has beams and the instrument's velocity alone is not
            requested.
    """
    account = Account(unit="line")
    pings = _join(read_events(data, account, trust=options.ignore_checksum), data, account)
    _clear_unsure(pings, account)
    with_beams = bool(pings.joined.any())
    if len(pings.position) and not with_beams and not options.instrument_only:
        raise DataError(ADVICE, place=place, hint="--instrument-only converts the velocities as they are")
    absolute = bool(pings.validity_us) and None not in pings.validity_us
    table, water = _table(pings, account, options, beams=_BEAMS if with_beams else 0, absolute=absolute)
    raise_if_empty(account, place, "velocity report")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="frd",
        clock="the instrument's, microseconds since 1970 where it is set" if absolute else "sum of intervals",
        time_of="validity" if absolute else "record",
        quality="signal strength rssi, dBm",
        geometry="waterlinked_a50",
        resolution_mps=1e-3,
        notes=[
            "a beam has no flag of its own: it counts as valid where its distance is not -1",
            *([] if absolute else ["the reports carry no clock: time is the sum of their intervals"]),
        ],
        water=water,
    )


def _table(
    pings: _Pings, account: Account, options: Options, *, beams: int, absolute: bool
) -> tuple[BeamTable, WaterTable | None]:
    """The tables of beams and of water; a beam is lost where its distance is negative."""
    interval = pings.velocity[:, 5]
    usable = np.isfinite(interval) & (np.abs(interval) <= 1e9)
    account.skip_where("no interval since the last report", ~usable, pings.position)
    if beams:
        missing = usable & ~pings.joined.all(axis=1)
        account.flag_where("transducer report missing", missing, pings.position)
    if absolute:
        times = [(t or 0) * 1000 for t, good in zip(pings.validity_us, usable.tolist(), strict=True) if good]
    else:
        # Whole numbers of Python: a sum of absurd intervals goes beyond 64 bits.
        times = list(accumulate(np.rint(interval[usable] * 1e6).astype(np.int64).tolist()))
    found = np.where(pings.joined[..., None], pings.beams, NAN)[usable][:, :beams]
    position, through_water = pings.position[usable], pings.water[usable]
    water = make_water(
        account,
        position[through_water],
        whole_times(times)[through_water],
        np.ones(int(through_water.sum())),
        np.full(int(through_water.sum()), WATER_RANGE_M),
        found[through_water, :, 0],
        found[through_water, :, 1] >= 0.0,
        negate=options.negate_beams,
    )
    account.flag_where("velocity through the water: no beam has the bottom", through_water, position)
    found[through_water] = NAN
    velocity, distance, rssi, noise = np.moveaxis(found, 2, 0)
    altitude, fom = pings.velocity[usable, 3], np.where(through_water, NAN, pings.velocity[usable, 4])
    table = make_table(
        account,
        beams,
        position,
        times,
        velocity,
        distance >= 0.0,
        range_m=np.where(distance >= 0.0, distance, NAN),
        quality=rssi,
        instrument=np.where(through_water[:, None], NAN, pings.velocity[usable, :3]),
        verdict=np.where(through_water, 0, pings.verdict[usable]),
        extra={
            "altitude_m": np.where(altitude >= 0.0, altitude, NAN),
            "instrument_sd_mps": fom,
            **{f"beam{k + 1}_noise_dbm": noise[:, k] for k in range(beams)},
        },
        negate=options.negate_beams,
    )
    return table, water
