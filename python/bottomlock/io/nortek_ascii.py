"""Nortek DVLs in text: `$PNORBT0` (DF351, plain) and `$PNORBT1` (DF350, tagged), a line a beam.

BV is the beam's velocity (-32.768 invalid), FOM its figure of merit (10 invalid), DIST the vertical distance (0
invalid), DT1 the milliseconds from the trigger to the echo's centre.
"""

import math
from dataclasses import dataclass

import numpy as np

from bottomlock.io.beam_table import Account, BeamTable, Flags, Floats, Integers, Recording
from bottomlock.io.civil_time import minute_ns
from bottomlock.io.dollar_sentences import Fields, Names, Remarks, Sentences, sentences
from bottomlock.io.framing import NortekLines, Stream
from bottomlock.io.lines import Bytes, is_text, running_xor
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, raise_if_empty

NAME = "nortek-ascii"
STREAM = Stream(NortekLines, figures=True)
MOST_BEAMS = 4
NO_VELOCITY_MPS, NO_FOM_MPS = -32.768, 10.0
TILT_RAD = math.radians(25.0)
"""Tilt of Nortek's DVL500 and DVL1000, to turn a vertical distance into one along the beam."""
_NAMES = Names(b"PNOR", letters=(0, 3), digits=2, longest=400)
_WANTED = (b"PNORBT0", b"PNORBT1")
_TAGS = (b"BEAM", b"DATE", b"TIME", b"DT1", b"DT2", b"BV", b"FOM", b"DIST", b"STAT")
_BEAM, _DATE, _TIME, _DT1, _BV, _FOM, _DIST = 0, 1, 2, 3, 5, 6, 7
_LOST = np.array([NO_VELOCITY_MPS, NO_FOM_MPS, 0.0, NAN])


@dataclass(frozen=True, eq=False)
class _Beams:
    """Beam lines, (n,) each; `numbers` (n, 4) holds velocity, figure of merit, vertical distance, DT1 (ms)."""

    position: Integers
    time_ns: Integers
    beam: Integers
    numbers: Floats


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b"$PNORBT" in head


def _untag(fields: Fields) -> tuple[Fields, Flags]:
    """Values in the order of DF351, also from the tagged form, and which lines have each tag in its place."""
    raw, begin = fields.lines.raw, fields.begin.copy()
    equals = np.append(fields.lines.places(b"="), len(raw))
    tagged = equals[np.searchsorted(equals, begin[:, 0])] < fields.end[:, 0]
    good = np.ones(len(tagged), dtype=bool)
    if not tagged.any():
        return fields, good
    for column, tag in enumerate(_TAGS):
        value = begin[:, column] + len(tag) + 1
        has = (value <= fields.end[:, column]) & is_text(raw, begin[:, column], value, tag + b"=")
        good &= has | ~tagged
        begin[:, column] = np.where(tagged & has, value, begin[:, column])
    return Fields(fields.lines, begin, fields.end), good


def _times(fields: Fields) -> tuple[Integers, Flags]:
    """MMDDYY and hhmmss.ssss as nanoseconds since 1970 (n,), and which are times."""
    raw, time, end = fields.lines.raw, fields.begin[:, _TIME], fields.end[:, _TIME]
    digits = [raw.take(time + k, mode="clip").astype(np.int64) - ord("0") for k in range(6)]
    good = (end - time >= 6) & (fields.end[:, _DATE] - fields.begin[:, _DATE] == 6)
    for digit in digits:
        good &= (digit >= 0) & (digit <= 9)
    rest = Fields(fields.lines, np.minimum(time + 4, end)[:, None], end[:, None])
    seconds, known = rest.numbers([0])
    second = seconds[:, 0]
    with np.errstate(invalid="ignore"):
        good &= known[:, 0] & (second >= 0.0) & (second < 61.0)
    date = np.array(
        [-1 if v is None or not g else v for v, g in zip(fields.wholes(_DATE), good, strict=True)]
    )
    month, day, year = date // 10_000, date // 100 % 100, 2000 + date % 100
    hour, minute = 10 * digits[0] + digits[1], 10 * digits[2] + digits[3]
    begin, sound = minute_ns(year, month, day, hour, minute)
    good &= sound & (date >= 0)
    return begin + np.rint(np.where(good, second, 0.0) * 1e9).astype(np.int64), good


def _beams(found: Sentences, remarks: Remarks) -> _Beams:
    """The beam lines among sentences; those with wrong fields are counted."""
    good, fields = found.fields(len(_TAGS))
    fields, use = _untag(fields)
    time_ns, timed = _times(fields)
    beam = np.array(
        [v if v is not None and 1 <= v <= MOST_BEAMS else 0 for v in fields.wholes(_BEAM)], dtype=np.int64
    )
    values, known = fields.numbers([_BV, _FOM, _DIST, _DT1])
    use &= timed & (beam > 0) & known.all(axis=1)
    good[good] = use
    remarks.skip("beam line with wrong fields", ~good, found.position, found.start, found.text)
    return _Beams(found.position[good], time_ns[use], beam[use], values[use])


def _read_beams(data: bytes, account: Account, *, trust: bool) -> _Beams:
    """Every good beam line of a file."""
    nothing = np.empty(0, dtype=np.int64)
    parts = [_Beams(nothing, nothing, nothing, np.empty((0, 4)))]
    for found, remarks in sentences(data, _NAMES, _WANTED, _fits, account, trust=trust):
        parts.append(_beams(found, remarks))
        remarks.tell()
    columns = ("position", "time_ns", "beam", "numbers")
    return _Beams(*(np.concatenate([getattr(part, name) for part in parts]) for name in columns))


def _fits(raw: Bytes, start: Integers, star: Integers, given: Integers) -> Flags:
    """The exclusive or of NMEA 0183."""
    return np.asarray(running_xor(raw)(start, star) == given)


def _pings(lines: _Beams) -> Integers:
    """(n,) the ping of each beam line: a new one begins with another time, or with a beam that is there already."""
    found, last, there, ping = [], None, 0, -1
    for time, beam in zip(lines.time_ns.tolist(), lines.beam.tolist(), strict=True):
        mark = 1 << beam
        if time != last or there & mark:
            ping, last, there = ping + 1, time, 0
        there |= mark
        found.append(ping)
    return np.array(found, dtype=np.int64)


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Beam lines, gathered to pings by their time.

    Raises:
        DataError: where there is no good beam line.
    """
    account = Account(unit="line")
    lines = _read_beams(data, account, trust=options.ignore_checksum)
    beams = int(lines.beam.max(initial=0))
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


def _table(lines: _Beams, beams: int, account: Account, *, negate: bool) -> BeamTable:
    """The table; what the manual says of invalid values becomes none."""
    ping = _pings(lines)
    first = np.flatnonzero(np.diff(ping, prepend=-1))
    values = np.tile(_LOST, (len(first), beams, 1))
    values[ping, lines.beam - 1] = lines.numbers
    there = np.bincount(ping, minlength=len(first))
    account.flag_where("beam line missing", there < beams, lines.position[first])
    velocity, fom, distance, dt1_ms = np.moveaxis(values, 2, 0)
    known = velocity > NO_VELOCITY_MPS + 1e-3
    return make_table(
        account,
        beams,
        lines.position[first],
        lines.time_ns[first],
        np.where(known, velocity, NAN),
        known & (fom < NO_FOM_MPS),
        range_m=np.where(distance > 0.0, distance / math.cos(TILT_RAD), NAN),
        sd=np.where(fom < NO_FOM_MPS, fom, NAN),
        extra={f"beam{k + 1}_delay_s": dt1_ms[:, k] * 1e-3 for k in range(beams)},
        negate=negate,
    )
