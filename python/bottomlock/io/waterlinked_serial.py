"""Water Linked DVLs on a serial line: `wrz` (velocity) with four `wru` (transducers), each with its CRC-8.

The instrument sends a `wrz` and then its transducers in order, so a `wru` belongs to the `wrz` before it unless a line
between them was damaged or lost. The deprecated `wrx` is a velocity too; `wrt` holds distances alone, so logs of `wrx`
and `wrt` have no beam velocities.
"""

import math
import re
from dataclasses import dataclass, field
from itertools import pairwise

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty
from bottomlock.io.sentences import LONGEST_LINE, crc8_07, hexadecimal, lines_of, number, whole

NAME = "waterlinked-serial"
_BEAMS = 4
_MISSING = 1.5
"""Intervals between two reports from which on one is missing between them."""
_DIGITS = re.compile(rb"[0-9]+")
_SENTENCE = re.compile(rb"wr[a-z!?](?:,[^*,]{0,200}){0,16}\*[0-9a-fA-F]{2}")
_KINDS = {
    b"wrt": "wrt (distances alone, deprecated)",
    b"wrp": "wrp (dead reckoning)",
    b"wrs": "wrs (two meanings by version)",
}
ADVICE = (
    "the log has velocities but no beams (wru): update the instrument's firmware to 2.1 or later, "
    "or record its TCP port 16171"
)


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return re.search(rb"(^|[\s\x00,])wr[zuxtp],-?\d", head) is not None


@dataclass
class _Ping:
    """A velocity report and the transducers that follow it; `lines` are those up to the next velocity report."""

    position: int
    velocity: tuple[float, float, float]
    verdict: int
    altitude: float
    fom: float
    interval_ms: float
    validity_us: int | None
    frame: tuple[bytes, bytes]
    lines: int = 1
    beams: dict[int, tuple[float, float, float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class _Sentence:
    """A good sentence, and what a logger wrote around it on its line."""

    fields: list[bytes]
    frame: tuple[bytes, bytes]


def _sentences(line: bytes, position: int, account: Account, *, trust: bool) -> list[_Sentence | None]:
    """The good sentences of a line in their order, None where something cannot be read; that is counted."""
    if len(line) > LONGEST_LINE:
        account.read += 1
        account.skip("line too long", position, line)
        return [None]
    found: list[_Sentence | None] = []
    at = end = 0
    while match := _SENTENCE.search(line, at):
        text, _, digits = match.group().rpartition(b"*")
        good = crc8_07(text) == hexadecimal(digits)
        inner = text.find(b"wr", 1)
        account.read += 1
        if not good and inner > 0:
            # A sentence that was cut off, then a whole one: look again from the second.
            account.skip("merged line", position, line)
            found.append(None)
            at = end = match.start() + inner
            continue
        before, at = line[end : match.start()], match.end()
        end = at
        if good or trust:
            found.append(_Sentence(text.split(b","), (_shape(before), _shape(line[at:]))))
            if not good:
                account.flag("bad checksum, kept on request", position, text)
        else:
            account.skip("bad checksum", position, match.group())
            found.append(None)
    if at == 0:
        account.read += 1
        account.skip("truncated" if b"wr" in line else "not a sentence", position, line)
        found.append(None)
    elif line[at:].strip():
        account.read += 1
        account.skip("truncated", position, line[at:])
    return found


def _shape(around: bytes) -> bytes:
    """What stands beside a sentence, without its digits: a logger's time stamp changes, its form does not."""
    return _DIGITS.sub(b"0", around.strip())


def _velocity(sentence: _Sentence, position: int) -> _Ping | None:
    """A `wrz` or `wrx` as a ping without beams yet; None where a field is not what it should be."""
    fields = sentence.fields
    if fields[0] == b"wrz" and len(fields) == 12:
        x, y, z, valid, altitude, fom, _, validity, _, interval, _ = fields[1:]
        validity_us = whole(validity)
    elif fields[0] == b"wrx" and len(fields) == 9:
        interval, x, y, z, fom, altitude, valid, _ = fields[1:]
        validity_us = None
    else:
        return None
    numbers = [number(text) for text in (x, y, z, altitude, fom, interval)]
    if any(value is None for value in numbers) or valid not in {b"y", b"n"}:
        return None
    vx, vy, vz, altitude_m, fom_mps, interval_ms = (NAN if v is None else v for v in numbers)
    verdict = int(valid == b"y")
    return _Ping(
        position, (vx, vy, vz), verdict, altitude_m, fom_mps, interval_ms, validity_us, sentence.frame
    )


def _transducer(fields: list[bytes]) -> tuple[int, tuple[float, float, float, float]] | None:
    """Id and velocity, distance, rssi, nsd of a `wru`."""
    if len(fields) != 6 or fields[1] not in {b"0", b"1", b"2", b"3"}:
        return None
    values = [number(text) for text in fields[2:]]
    velocity, distance, rssi, nsd = (NAN if v is None else v for v in values)
    return (int(fields[1]), (velocity, distance, rssi, nsd)) if None not in values else None


@dataclass
class _Joining:
    """Joins transducer reports to the velocity report before them.

    The reports carry no number of their ping. The instrument sends a `wrz` and then `wru` 0, 1, 2, 3, so whatever
    departs from that closes the ping: a line that cannot be read may have been the next `wrz`, and a missing number
    shows a lost line.
    """

    account: Account
    pings: list[_Ping] = field(default_factory=list)
    open: bool = False

    def velocity(self, sentence: _Sentence, position: int) -> None:
        """A `wrz` opens a ping; a `wrx` is one without transducers."""
        ping = _velocity(sentence, position)
        self.open = ping is not None and sentence.fields[0] == b"wrz"
        if ping is None:
            self.account.skip("velocity report with wrong fields", position, b",".join(sentence.fields))
        else:
            self.pings.append(ping)

    def transducer(self, sentence: _Sentence, position: int) -> None:
        """A `wru`: joined where it is the next of the open ping; else it closes the ping and is skipped."""
        transducer = _transducer(sentence.fields)
        if transducer is None:
            self.account.skip("transducer report with wrong fields", position, b",".join(sentence.fields))
        elif not self.pings:
            self.account.skip("transducer report before any velocity", position)
        elif not self.open:
            self.account.skip("transducer report after a lost line", position)
        elif transducer[0] != len(self.pings[-1].beams) or sentence.frame != self.pings[-1].frame:
            self.account.skip("transducer report without its velocity report", position)
        else:
            self.pings[-1].beams[transducer[0]] = transducer[1]
            self.pings[-1].lines += 1
            self.account.pass_by("wru (joined to its wrz)", position)
            return
        self.lost()

    def lost(self) -> None:
        """A line that is not, or not as it was sent."""
        self.open = False
        if self.pings:
            self.pings[-1].lines += 1


def _pings(data: bytes, account: Account, *, trust: bool) -> list[_Ping]:
    joining = _Joining(account)
    for position, line in lines_of(data):
        for sentence in _sentences(line, position, account, trust=trust):
            kind = b"" if sentence is None else sentence.fields[0]
            if sentence is None:
                joining.lost()
            elif kind in {b"wrz", b"wrx"}:
                joining.velocity(sentence, position)
            elif kind == b"wru":
                joining.transducer(sentence, position)
            else:
                account.pass_by(_KINDS.get(kind, kind.decode("ascii", "replace")), position)
                # A kept sentence with a wrong checksum may have been a velocity report.
                if trust and kind not in _KINDS:
                    joining.lost()
    return joining.pings


def _clear_unsure(pings: list[_Ping], account: Account) -> None:
    """Takes the transducers from pings after which lines are missing without a trace.

    Of two reports in the log the second states its interval to the report before it. Where their times of validity lie
    further apart, a report is missing between them. If its lines are there, damaged, it closed the ping. If they are
    not, the transducers may be those of the missing report.
    """
    for ping, after in pairwise(pings):
        if ping.validity_us is None or after.validity_us is None or not after.interval_ms > 0.0:
            continue
        intervals = (after.validity_us - ping.validity_us) / (1000.0 * after.interval_ms)
        if ping.beams and intervals > _MISSING and ping.lines < (_BEAMS + 1) * max(2, round(intervals)):
            account.flag("lines missing after this report: its transducers may be another's", ping.position)
            ping.beams.clear()


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Velocity reports with their transducers.

    Raises:
        DataError: where there is no velocity report, or none has beams and the instrument's velocity alone is not
            requested.
    """
    account = Account(unit="line")
    pings = _pings(data, account, trust=options.ignore_checksum)
    _clear_unsure(pings, account)
    with_beams = any(ping.beams for ping in pings)
    if pings and not with_beams and not options.instrument_only:
        raise DataError(f"{place}: {ADVICE}; --instrument-only converts the velocities as they are")
    absolute = bool(pings) and all(ping.validity_us is not None for ping in pings)
    rows = Rows(_BEAMS if with_beams else 0, account)
    sum_ns = 0
    for ping in pings:
        if not math.isfinite(ping.interval_ms) or abs(ping.interval_ms) > 1e9:
            account.skip("no interval since the last report", ping.position)
            continue
        sum_ns += round(ping.interval_ms * 1e6)
        time_ns = (ping.validity_us or 0) * 1000 if absolute else sum_ns
        if with_beams and len(ping.beams) < _BEAMS:
            account.flag("transducer report missing", ping.position)
        _add(rows, ping, time_ns)
    table = rows.finish(negate=options.negate_beams)
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
    )


def _add(rows: Rows, ping: _Ping, time_ns: int) -> None:
    """A ping to the table; a beam is lost where its distance is negative."""
    lost = (NAN, NAN, NAN, NAN)
    beams = [ping.beams.get(k, lost) for k in range(rows.beams)]
    rows.add(
        ping.position,
        time_ns,
        [b[0] for b in beams],
        [b[1] >= 0.0 for b in beams],
        range_m=[b[1] if b[1] >= 0.0 else NAN for b in beams],
        quality=[b[2] for b in beams],
        instrument=ping.velocity,
        verdict=ping.verdict,
        extra={
            "altitude_m": ping.altitude if ping.altitude >= 0.0 else NAN,
            "instrument_sd_mps": ping.fom,
            **{f"beam{k + 1}_noise_dbm": b[3] for k, b in enumerate(beams)},
        },
    )
