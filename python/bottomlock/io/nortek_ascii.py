"""Nortek DVLs in text: `$PNORBT0` (DF351, plain) and `$PNORBT1` (DF350, tagged), a line a beam.

BV is the beam's velocity (-32.768 invalid), FOM its figure of merit (10 invalid), DIST the vertical distance (0
invalid), DT1 the milliseconds from the trigger to the echo's centre.
"""

import datetime as dt
import math
import re

from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.lines import lines_with
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty
from bottomlock.io.sentences import LONGEST_LINE, hexadecimal, number, whole, xor_of

NAME = "nortek-ascii"
MOST_BEAMS = 4
NO_VELOCITY_MPS, NO_FOM_MPS = -32.768, 10.0
TILT_RAD = math.radians(25.0)
"""Tilt of Nortek's DVL500 and DVL1000, to turn a vertical distance into one along the beam."""
_SENTENCE = re.compile(rb"\$(PNOR[A-Z]{0,3}[0-9]{0,2}(?:,[^*$]{0,400})?)\*([0-9A-Fa-f]{2})")
_TAGS = (b"BEAM", b"DATE", b"TIME", b"DT1", b"DT2", b"BV", b"FOM", b"DIST", b"STAT")
_EPOCH = dt.date(1970, 1, 1).toordinal()

Beam = tuple[int, float, float, float, float]


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
    day, seconds = whole(date), time[4:]
    second, clock = number(seconds), whole(time[:4])
    if day is None or second is None or clock is None or len(date) != 6 or not time[:4].isdigit():
        return None
    month, rest = divmod(day, 10_000)
    hour, minute = divmod(clock, 100)
    if hour > 23 or minute > 59 or not 0.0 <= second < 61.0:
        return None
    try:
        ordinal = dt.date(2000 + rest % 100, month, rest // 100).toordinal() - _EPOCH
    except ValueError:
        return None
    return (ordinal * 86_400 + hour * 3600 + minute * 60) * 1_000_000_000 + round(second * 1e9)


def _beam(fields: list[bytes]) -> tuple[int, Beam] | None:
    """Time of a line, and its beam number, velocity, figure of merit, distance, DT1 (s)."""
    if len(fields) != 9:
        return None
    values = _untag(fields) if b"=" in fields[0] else fields
    if values is None:
        return None
    time_ns, beam = _time_ns(values[1], values[2]), whole(values[0])
    numbers = [number(values[k]) for k in (5, 6, 7, 3)]
    if time_ns is None or beam is None or not 1 <= beam <= MOST_BEAMS or None in numbers:
        return None
    velocity, fom, distance, dt1_ms = (NAN if v is None else v for v in numbers)
    return time_ns, (beam, velocity, fom, distance, dt1_ms * 1e-3)


def _lines(data: bytes, account: Account, *, trust: bool) -> list[tuple[int, int, Beam]]:
    """Position, time and beam of every good line."""
    found = []
    for position, line in lines_with(data, b"$", account, "not a sentence", LONGEST_LINE):
        at = 0
        account.read += 1
        if len(line) > LONGEST_LINE:
            account.skip("line too long", position, line)
            continue
        while match := _SENTENCE.search(line, at):
            account.read += at > 0
            at = match.end()
            text = match.group(1)
            if xor_of(text) != hexadecimal(match.group(2)):
                if not trust:
                    account.skip("bad checksum", position, match.group())
                    continue
                account.flag("bad checksum, kept on request", position, match.group())
            name, *fields = text.split(b",")
            if name not in {b"PNORBT0", b"PNORBT1"}:
                account.pass_by("$" + name.decode("ascii"), position)
                continue
            beam = _beam(fields)
            if beam is None:
                account.skip("beam line with wrong fields", position, text)
            else:
                found.append((position, *beam))
        if at == 0:
            account.skip("truncated", position, line)
        elif line[at:].strip():
            account.read += 1
            account.skip("truncated", position, line[at:])
    return found


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Beam lines, gathered to pings by their time.

    Raises:
        DataError: where there is no good beam line.
    """
    account = Account(unit="line")
    found = _lines(data, account, trust=options.ignore_checksum)
    beams = max((beam[0] for _, _, beam in found), default=0)
    rows = Rows(beams, account)
    ping: dict[int, Beam] = {}
    first = time = 0
    for position, time_ns, beam in found:
        if ping and (time_ns != time or beam[0] in ping):
            _add(rows, first, time, ping)
            ping = {}
        if not ping:
            first, time = position, time_ns
        ping[beam[0]] = beam
    if ping:
        _add(rows, first, time, ping)
    table = rows.finish(negate=options.negate_beams)
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


def _add(rows: Rows, position: int, time_ns: int, ping: dict[int, Beam]) -> None:
    """A ping to the table; what the manual says of invalid values becomes none."""
    if len(ping) < rows.beams:
        rows.account.flag("beam line missing", position)
    lost = (0, NO_VELOCITY_MPS, NO_FOM_MPS, 0.0, NAN)
    beams = [ping.get(k + 1, lost) for k in range(rows.beams)]
    known = [v > NO_VELOCITY_MPS + 1e-3 for _, v, _, _, _ in beams]
    rows.add(
        position,
        time_ns,
        [v if good else NAN for (_, v, _, _, _), good in zip(beams, known, strict=True)],
        [good and fom < NO_FOM_MPS for (_, _, fom, _, _), good in zip(beams, known, strict=True)],
        range_m=[d / math.cos(TILT_RAD) if d > 0.0 else NAN for _, _, _, d, _ in beams],
        sd=[fom if fom < NO_FOM_MPS else NAN for _, _, fom, _, _ in beams],
        extra={f"beam{k + 1}_delay_s": b[4] for k, b in enumerate(beams)},
    )
