"""Nortek DVLs in text: `$PNORBT0` (DF351, plain) and `$PNORBT1` (DF350, tagged), a line a beam.

BV is the beam's velocity (-32.768 invalid), FOM its figure of merit (10 invalid), DIST the vertical distance (0
invalid), DT1 the milliseconds from the trigger to the echo's centre.
"""

import datetime as dt
import math

import numpy as np

from bottomlock.io.beam_table import Account, BeamTable, Recording
from bottomlock.io.dollar_sentences import pattern, sentences
from bottomlock.io.framing import NortekLines, Stream
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty
from bottomlock.io.sentences import number, whole, xor_of

NAME = "nortek-ascii"
STREAM = Stream(NortekLines, figures=True)
MOST_BEAMS = 4
NO_VELOCITY_MPS, NO_FOM_MPS = -32.768, 10.0
TILT_RAD = math.radians(25.0)
"""Tilt of Nortek's DVL500 and DVL1000, to turn a vertical distance into one along the beam."""
_FORM = pattern(rb"PNOR[A-Z]{0,3}[0-9]{0,2}", 400)
_TAGS = (b"BEAM", b"DATE", b"TIME", b"DT1", b"DT2", b"BV", b"FOM", b"DIST", b"STAT")
_BEAM, _DATE, _TIME, _DT1, _BV, _FOM, _DIST = 0, 1, 2, 3, 5, 6, 7
_LOST = np.array([NO_VELOCITY_MPS, NO_FOM_MPS, 0.0, NAN])
_EPOCH = dt.datetime(1970, 1, 1)  # noqa: DTZ001 - as the times, without a zone

Beam = tuple[int, int, int, tuple[float, ...]]
"""Line, time (ns since 1970), beam from 1, and velocity, figure of merit, vertical distance, DT1 (ms)."""


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"$PNORBT" in head


def _untag(fields: list[bytes]) -> list[bytes] | None:
    """Values in the order of DF351, from the tagged form; None where a tag is missing or out of place."""
    values = []
    for tag, text in zip(_TAGS, fields, strict=True):
        name, equals, value = text.partition(b"=")
        if not equals or name != tag:
            return None
        values.append(value)
    return values


def _time_ns(date: bytes, time: bytes) -> int | None:
    """MMDDYY and hhmmss.ssss as nanoseconds since 1970."""
    day, second = whole(date), number(time[4:])
    if len(date) != 6 or day is None or not time[:6].isdigit() or second is None or not 0.0 <= second < 61.0:
        return None
    month, rest = divmod(day, 10_000)
    try:
        minute = dt.datetime(2000 + rest % 100, month, rest // 100, int(time[:2]), int(time[2:4]))  # noqa: DTZ001
    except ValueError:
        return None
    return (minute - _EPOCH) // dt.timedelta(minutes=1) * 60_000_000_000 + round(second * 1e9)


def _beam(position: int, fields: list[bytes]) -> Beam | None:
    """A beam line, from its fields; None where they are not what they should be."""
    values = fields if len(fields) == len(_TAGS) else None
    if values and b"=" in values[_BEAM]:
        values = _untag(values)
    if values is None:
        return None
    time_ns, beam = _time_ns(values[_DATE], values[_TIME]), whole(values[_BEAM])
    numbers = tuple(v for k in (_BV, _FOM, _DIST, _DT1) if (v := number(values[k])) is not None)
    if time_ns is None or beam is None or not 1 <= beam <= MOST_BEAMS or len(numbers) < len(_LOST):
        return None
    return position, time_ns, beam, numbers


def _read_beams(data: bytes, account: Account, *, trust: bool) -> list[Beam]:
    """Every good beam line of a file."""
    found = []
    wanted = (b"PNORBT0", b"PNORBT1")
    for position, text in sentences(data, _FORM, wanted, _fits, account, trust=trust):
        beam = _beam(position, text.split(b",")[1:])
        if beam is None:
            account.skip("beam line with wrong fields", position, text)
        else:
            found.append(beam)
    return found


def _fits(text: bytes, given: int) -> bool:
    """The exclusive or of NMEA 0183."""
    return xor_of(text) == given


def _pings(lines: list[Beam]) -> list[int]:
    """The ping of each beam line: a new one begins with another time, or with a beam that is there already."""
    found, last, ping = [], None, -1
    there: set[int] = set()
    for _, time_ns, beam, _ in lines:
        if time_ns != last or beam in there:
            ping, last, there = ping + 1, time_ns, set()
        there.add(beam)
        found.append(ping)
    return found


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Beam lines, gathered to pings by their time.

    Raises:
        DataError: where there is no good beam line.
    """
    account = Account(unit="line")
    lines = _read_beams(data, account, trust=options.ignore_checksum)
    beams = max((beam for _, _, beam, _ in lines), default=0)
    table = _table(lines, beams, account, negate=options.negate_beams)
    raise_if_empty(account, place, "beam line $PNORBT0 or $PNORBT1")
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="none",
        clock="the instrument's, UTC if it was set so",
        time_of="record",
        corrected=["distance is vertical: divided by the cosine of 25 deg to lie along the beam"],
        geometry="nortek_dvl1000" if beams == MOST_BEAMS else "",
        resolution_mps=1e-5,
        notes=[
            "the sentence carries no velocity of the instrument's own",
            "time is that of the sentence; beam1_delay_s ... hold its DT1, trigger to centre of echo",
            "sign not confirmed on a recording: positive towards the bottom is assumed; --negate-beams turns it",
        ],
    )


def _table(lines: list[Beam], beams: int, account: Account, *, negate: bool) -> BeamTable:
    """The table; what the manual says of invalid values becomes none."""
    ping = np.array(_pings(lines), dtype=np.int64)
    position, time_ns, beam = np.array([line[:3] for line in lines], dtype=np.int64).reshape(-1, 3).T
    first = np.flatnonzero(np.diff(ping, prepend=-1))
    values = np.tile(_LOST, (len(first), beams, 1))
    values[ping, beam - 1] = np.array([line[3] for line in lines]).reshape(-1, len(_LOST))
    there = np.bincount(ping, minlength=len(first))
    account.flag_where("beam line missing", there < beams, position[first])
    velocity, fom, distance, dt1_ms = np.moveaxis(values, 2, 0)
    known = velocity > NO_VELOCITY_MPS + 1e-3
    return make_table(
        account,
        beams,
        position[first],
        time_ns[first],
        np.where(known, velocity, NAN),
        known & (fom < NO_FOM_MPS),
        range_m=np.where(distance > 0.0, distance / math.cos(TILT_RAD), NAN),
        sd=np.where(fom < NO_FOM_MPS, fom, NAN),
        extra={f"beam{k + 1}_delay_s": dt1_ms[:, k] * 1e-3 for k in range(beams)},
        negate=negate,
    )
