"""Water Linked DVLs on a serial line: `wrz` (velocity) with four `wru` (transducers), each with its CRC-8.

The instrument sends a `wrz` and then its transducers in order, so a `wru` belongs to the `wrz` before it unless a line
between them was damaged or lost. In water tracking (version 2.7) a `wrs` stands in place of the `wrz`: it is a ping
whose beams have no bottom, and a cell of the water. The deprecated `wrx` is a velocity too; `wrt` holds distances
alone, so logs of `wrx` and `wrt` have no beam velocities.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.decoder import Format, LineDecoder, Row
from bottomlock.io.rows import NAN
from bottomlock.io.sentences import crc8_of, number, whole
from bottomlock.io.waterlinked_json import row_of

_BEAMS = 4
_MISSING = 1.5
"""Intervals between two reports from which on one is missing between them."""
_SENTENCE = re.compile(rb"(wr[a-z!?](?:,[^*,]{0,200}){0,16})\*([0-9a-fA-F]{2})")
_DIGITS = re.compile(rb"[0-9]+")
_WATER_FIELDS = 11
_LAYOUTS = {
    b"wrz": (12, (1, 2, 3, 5, 6, 10), 4, 8),
    b"wrs": (_WATER_FIELDS, (1, 2, 3, 5, 5, 9), 4, 7),
    b"wrx": (9, (2, 3, 4, 6, 5, 1), 7, None),
}
"""Of velocities: fields; those of x, y, z, altitude (none of a `wrs`), figure of merit, interval; of flag and time."""
_OTHERS = {
    b"wrt": "wrt (distances alone, deprecated)",
    b"wrp": "wrp (dead reckoning)",
    b"wrs": "wrs (no velocity through the water)",
}
ADVICE = (
    "the log has velocities but no beams (wru): update the instrument's firmware to 2.1 or later, "
    "or record its TCP port 16171"
)


Frame = tuple[bytes, bytes]
"""What a logger wrote before and behind a sentence, without its digits: a time stamp changes, its form does not."""


@dataclass
class _Ping:
    """A velocity report and the transducers that follow it.

    Attributes:
        position: line of the report.
        water: the report is one of the water.
        velocity: x, y, z, altitude, figure of merit, interval (ms).
        verdict: 1 and 0 as the instrument flags its velocity.
        validity_us: time of validity, None where there is none.
        sent_us: time of transmission, None where there is none.
        frame: around the report.
        lines: those up to the next velocity report.
        beams: velocity, distance, rssi and nsd of transducers 0, 1, ...
    """

    position: int
    water: bool
    velocity: list[float]
    verdict: int
    validity_us: int | None
    sent_us: int | None
    frame: Frame
    lines: int = 1
    beams: list[list[float]] = field(default_factory=list)


def _shape(around: bytes) -> bytes:
    return _DIGITS.sub(b"0", around.strip())


def _numbers(fields: list[bytes], columns: tuple[int, ...]) -> list[float] | None:
    """Some fields as numbers, None where one is none."""
    found = [v for k in columns if (v := number(fields[k])) is not None]
    return found if len(found) == len(columns) else None


def _velocity(fields: list[bytes], position: int, frame: Frame) -> _Ping | None:
    """A velocity report as a ping without beams yet; None where a field is not what it should be."""
    count, columns, flag, validity = _LAYOUTS[fields[0]]
    numbers = _numbers(fields, columns) if len(fields) == count else None
    if numbers is None or fields[flag] not in {b"y", b"n"}:
        return None
    water = fields[0] == b"wrs"
    if water:
        numbers[3] = NAN
    times = (None, None) if validity is None else (whole(fields[validity]), whole(fields[validity + 1]))
    return _Ping(position, water, numbers, int(fields[flag] == b"y"), *times, frame)


def _clear_unsure(pings: list[_Ping], account: Account) -> None:
    """Takes the transducers from pings after which lines are missing without a trace.

    Of two reports in the log the second states its interval to the report before it. Where their times of validity lie
    further apart, a report is missing between them. If its lines are there, damaged, it closed the ping. If they are
    not, the transducers may be those of the missing report.
    """
    for ping, after in pairwise(pings):
        interval_us = 1000.0 * after.velocity[5]
        if ping.validity_us is None or after.validity_us is None or not interval_us > 0.0:
            continue
        intervals = (after.validity_us - ping.validity_us) / interval_us
        if ping.beams and intervals > _MISSING and ping.lines < (_BEAMS + 1) * max(2.0, np.rint(intervals)):
            account.flag("lines missing after this report: its transducers may be another's", ping.position)
            ping.beams.clear()


class _Decoder(LineDecoder):
    """Joins transducer reports to the velocity report before them.

    The reports carry no number of their ping. The instrument sends a `wrz` and then `wru` 0, 1, 2, 3, so whatever
    departs from that closes the ping: a line that cannot be read may have been the next `wrz`, and a missing number
    shows a lost line.
    """

    frame = "frd"

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self._pings: list[_Ping] = []
        self._last: _Ping | None = None
        self._open = False
        self._sum_ns = 0
        self._absolute: bool | None = None

    def line(self, position: int, line: bytes) -> None:
        """Takes the sentences of a line; what is lost is counted."""
        account, at = self.account, 0
        while match := _SENTENCE.search(line, at):
            text, digits = match.groups()
            good = crc8_of(text, 0x107) == int(digits, 16)
            inner = text.find(b"wr", 1)
            account.read += 1
            if not good and inner > 0:
                # A sentence that was cut off, then a whole one: look again from the second.
                account.skip("merged line", position, line)
                at = match.start() + inner
                self.lost()
                continue
            before, at = line[at : match.start()], match.end()
            if good:
                self._sentence(text, position, (_shape(before), _shape(line[at:])))
            else:
                account.skip("bad checksum", position, match.group())
                self.lost()
        if not at:
            account.read += 1
            account.skip("truncated" if b"wr" in line else "not a sentence", position, line)
            self.lost()
        elif line[at:].strip():
            account.read += 1
            account.skip("truncated", position, line[at:])

    def _sentence(self, text: bytes, position: int, frame: Frame) -> None:
        kind = text[:3]
        if kind in {b"wrz", b"wrx"} or (kind == b"wrs" and text.count(b",") == _WATER_FIELDS - 1):
            ping = _velocity(text.split(b","), position, frame)
            # A `wrx` is one without transducers.
            self._open = ping is not None and kind != b"wrx"
            if ping is None:
                self.account.skip("velocity report with wrong fields", position, text)
            else:
                self._last = ping
                self._pings.append(ping)
        elif kind == b"wru":
            self._transducer(text, position, frame)
        else:
            self.account.pass_by(_OTHERS.get(kind, kind.decode("ascii")), position)

    def _transducer(self, text: bytes, position: int, frame: Frame) -> None:
        """A `wru`: joined where it is the next of the open ping; else it closes the ping and is skipped."""
        fields, ping = text.split(b","), self._last
        beam = _numbers(fields, (2, 3, 4, 5)) if len(fields) == 6 else None
        if beam is None or fields[1] not in {b"0", b"1", b"2", b"3"}:
            self.account.skip("transducer report with wrong fields", position, text)
        elif ping is None:
            self.account.skip("transducer report before any velocity", position)
        elif not self._open:
            self.account.skip("transducer report after a lost line", position)
        elif int(fields[1]) != len(ping.beams) or frame != ping.frame:
            self.account.skip("transducer report without its velocity report", position)
        else:
            ping.beams.append(beam)
            ping.lines += 1
            self.account.pass_by("wru (joined to its wrz or wrs)", position)
            return
        self.lost()

    def lost(self) -> None:
        """A line that is not, or not as it was sent."""
        self._open = False
        if self._last is not None:
            self._last.lines += 1

    @property
    def waiting(self) -> bool:
        """Whether transducers of the last ping may come."""
        return self._open and self._last is not None and len(self._last.beams) < _BEAMS

    def flush(self) -> None:
        """Ends the last ping."""
        self._open = False

    def reset(self) -> None:
        """Forgets a ping and a line that have begun."""
        if self.waiting:
            self._pings.pop()
        self._open = False
        super().reset()

    def ready(self) -> list[Row]:
        """The pings that are whole; the first one says whether the stream has a clock."""
        held = [self._pings.pop()] if self.waiting else []
        pings, self._pings = self._pings, held
        if self._absolute is None and pings:
            self._absolute = pings[0].validity_us is not None
        fits = [ping for ping in pings if (ping.validity_us is not None) == self._absolute]
        if len(fits) < len(pings):
            reason = "no time of validity" if self._absolute else "a time of validity among intervals"
            self.account.skip(reason, pings[0].position, count=len(pings) - len(fits))
        return self._rows(fits, _BEAMS, absolute=bool(self._absolute))

    def _rows(self, pings: Sequence[_Ping], beams: int, *, absolute: bool) -> list[Row]:
        """The rows of pings whose interval is known; a beam is lost where its distance is negative."""
        rows = []
        for ping in pings:
            *own, interval_ms = ping.velocity
            if not abs(interval_ms) <= 1e9:
                self.account.skip("no interval since the last report", ping.position)
                continue
            if len(ping.beams) < beams:
                self.account.flag("transducer report missing", ping.position)
            self._sum_ns += round(interval_ms * 1e6)
            lost = [[NAN] * 4] * (_BEAMS - len(ping.beams))
            time_ns = (ping.validity_us or 0) * 1000 if absolute else self._sum_ns
            sent_ns = ping.sent_us * 1000 if absolute and ping.sent_us is not None else None
            row = row_of(ping.position, time_ns, [*ping.beams, *lost], own, sent_ns, through_water=ping.water)
            row.verdict = ping.verdict
            rows.append(row)
        return rows

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`; DataError also where no ping has beams and they are not given up."""
        pings, account = self._pings, self.account
        _clear_unsure(pings, account)
        with_beams = any(ping.beams for ping in pings)
        if pings and not with_beams and not self.options.instrument_only:
            raise DataError(
                ADVICE, place=self.place, hint="--instrument-only converts the velocities as they are"
            )
        absolute = bool(pings) and all(ping.validity_us is not None for ping in pings)
        beams = _BEAMS if with_beams else 0
        rows = self._rows(pings, beams, absolute=absolute)
        for row in rows:
            if row.water_m is not None:
                account.flag("velocity through the water: no beam has the bottom", row.position)
        return replace(
            self.tables("velocity report", beams, rows),
            clock="the instrument's, microseconds since 1970 where it is set"
            if absolute
            else "sum of intervals",
            time_of="validity" if absolute else "record",
            quality="signal strength rssi, dBm",
            geometry="waterlinked_a50",
            resolution_mps=1e-3,
            notes=[
                "a beam has no flag of its own: it counts as valid where its distance is not -1",
                *([] if absolute else ["the reports carry no clock: time is the sum of their intervals"]),
            ],
        )


def _sniff(head: bytes) -> bool:
    return re.search(rb"(^|[\s\x00,])wr[zuxtps],-?\d", head) is not None


FORMAT = Format("waterlinked-serial", "Water Linked serial, wrz, wru", _sniff, _Decoder)
