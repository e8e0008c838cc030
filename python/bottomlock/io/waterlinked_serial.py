"""Water Linked DVLs on a serial line: `wrz` (velocity) with four `wru` (transducers), each with its CRC-8.

The instrument sends a `wrz` and then its transducers in order, so a `wru` belongs to the `wrz` before it unless a line
between them was damaged or lost. In water tracking (version 2.7) a `wrs` stands in place of the `wrz`: it is a ping
whose beams have no bottom, and a cell of the water. The deprecated `wrx` is a velocity too; `wrt` holds distances
alone, so logs of `wrx` and `wrt` have no beam velocities.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import accumulate, pairwise

import numpy as np

from bottomlock.errors import DataError
from bottomlock.io.beam_table import Account, BeamTable, Recording, WaterTable
from bottomlock.io.framing import Stream, WaterLinkedLines
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, make_water, raise_if_empty, whole_times
from bottomlock.io.sentences import LONGEST_LINE, crc8_of, lines_of, number, whole
from bottomlock.io.waterlinked_json import WATER_RANGE_M

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


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return re.search(rb"(^|[\s\x00,])wr[zuxtps],-?\d", head) is not None


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
        frame: around the report.
        lines: those up to the next velocity report.
        beams: velocity, distance, rssi and nsd of transducers 0, 1, ...
    """

    position: int
    water: bool
    velocity: list[float]
    verdict: int
    validity_us: int | None
    frame: Frame
    lines: int = 1
    beams: list[list[float]] = field(default_factory=list)


def _sentences(
    line: bytes, position: int, account: Account, *, trust: bool
) -> Iterator[tuple[bytes, Frame] | None]:
    """The good sentences of a line, None where a line or sentence cannot be read; what is lost is counted."""
    if len(line) > LONGEST_LINE:
        account.read += 1
        account.skip("line too long", position, line)
        yield None
        return
    at = 0
    while match := _SENTENCE.search(line, at):
        text, digits = match.groups()
        good = crc8_of(text, 0x107) == int(digits, 16)
        inner = text.find(b"wr", 1)
        account.read += 1
        if not good and inner > 0:
            # A sentence that was cut off, then a whole one: look again from the second.
            account.skip("merged line", position, line)
            at = match.start() + inner
            yield None
            continue
        before, at = line[at : match.start()], match.end()
        if good or trust:
            if not good:
                account.flag("bad checksum, kept on request", position, text)
            yield text, (_shape(before), _shape(line[at:]))
        else:
            account.skip("bad checksum", position, match.group())
            yield None
    if not at:
        account.read += 1
        account.skip("truncated" if b"wr" in line else "not a sentence", position, line)
        yield None
    elif line[at:].strip():
        account.read += 1
        account.skip("truncated", position, line[at:])


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
    validity_us = None if validity is None else whole(fields[validity])
    return _Ping(position, water, numbers, int(fields[flag] == b"y"), validity_us, frame)


class _Joining:
    """Joins transducer reports to the velocity report before them.

    The reports carry no number of their ping. The instrument sends a `wrz` and then `wru` 0, 1, 2, 3, so whatever
    departs from that closes the ping: a line that cannot be read may have been the next `wrz`, and a missing number
    shows a lost line.
    """

    def __init__(self, account: Account) -> None:
        self.pings: list[_Ping] = []
        self._account, self._open = account, False

    def velocity(self, text: bytes, position: int, frame: Frame) -> None:
        """A velocity opens a ping; a `wrx` is one without transducers."""
        ping = _velocity(text.split(b","), position, frame)
        self._open = ping is not None and not text.startswith(b"wrx")
        if ping is None:
            self._account.skip("velocity report with wrong fields", position, text)
        else:
            self.pings.append(ping)

    def transducer(self, text: bytes, position: int, frame: Frame) -> None:
        """A `wru`: joined where it is the next of the open ping; else it closes the ping and is skipped."""
        fields = text.split(b",")
        beam = _numbers(fields, (2, 3, 4, 5)) if len(fields) == 6 else None
        if beam is None or fields[1] not in {b"0", b"1", b"2", b"3"}:
            self._account.skip("transducer report with wrong fields", position, text)
        elif not self.pings:
            self._account.skip("transducer report before any velocity", position)
        elif not self._open:
            self._account.skip("transducer report after a lost line", position)
        elif int(fields[1]) != len(self.pings[-1].beams) or frame != self.pings[-1].frame:
            self._account.skip("transducer report without its velocity report", position)
        else:
            self.pings[-1].beams.append(beam)
            self.pings[-1].lines += 1
            self._account.pass_by("wru (joined to its wrz or wrs)", position)
            return
        self.lost()

    def lost(self) -> None:
        """A line that is not, or not as it was sent."""
        self._open = False
        if self.pings:
            self.pings[-1].lines += 1


def _pings(data: bytes, account: Account, *, trust: bool) -> list[_Ping]:
    """The pings of a file; the account lists the lines that are none of theirs."""
    joining = _Joining(account)
    for position, line in lines_of(data):
        for sentence in _sentences(line, position, account, trust=trust):
            if sentence is None:
                joining.lost()
                continue
            text, frame = sentence
            kind = text[:3]
            if kind in {b"wrz", b"wrx"} or (kind == b"wrs" and text.count(b",") == _WATER_FIELDS - 1):
                joining.velocity(text, position, frame)
            elif kind == b"wru":
                joining.transducer(text, position, frame)
            else:
                account.pass_by(_OTHERS.get(kind, kind.decode("ascii")), position)
                # A kept sentence with a wrong checksum may have been a velocity report.
                if trust and kind not in _OTHERS:
                    joining.lost()
    return joining.pings


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
        raise DataError(ADVICE, place=place, hint="--instrument-only converts the velocities as they are")
    absolute = bool(pings) and all(ping.validity_us is not None for ping in pings)
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
    pings: list[_Ping], account: Account, options: Options, *, beams: int, absolute: bool
) -> tuple[BeamTable, WaterTable | None]:
    """The tables of beams and of water; a beam is lost where its distance is negative."""
    usable = []
    for ping in pings:
        if not abs(ping.velocity[5]) <= 1e9:
            account.skip("no interval since the last report", ping.position)
            continue
        usable.append(ping)
        if len(ping.beams) < beams:
            account.flag("transducer report missing", ping.position)
    if absolute:
        times = [(ping.validity_us or 0) * 1000 for ping in usable]
    else:
        times = list(accumulate(round(ping.velocity[5] * 1e6) for ping in usable))
    lost = [[NAN] * 4] * beams
    found = np.array([(ping.beams + lost)[:beams] for ping in usable]).reshape(len(usable), beams, 4)
    reports = np.array([ping.velocity for ping in usable]).reshape(-1, 6)
    position = np.array([ping.position for ping in usable], dtype=np.int64)
    through_water = np.array([ping.water for ping in usable], dtype=bool)
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
    altitude, fom = reports[:, 3], np.where(through_water, NAN, reports[:, 4])
    table = make_table(
        account,
        beams,
        position,
        times,
        velocity,
        distance >= 0.0,
        range_m=np.where(distance >= 0.0, distance, NAN),
        quality=rssi,
        instrument=np.where(through_water[:, None], NAN, reports[:, :3]),
        verdict=np.where(through_water, 0, [ping.verdict for ping in usable]),
        extra={
            "altitude_m": np.where(altitude >= 0.0, altitude, NAN),
            "instrument_sd_mps": fom,
            **{f"beam{k + 1}_noise_dbm": noise[:, k] for k in range(beams)},
        },
        negate=options.negate_beams,
    )
    return table, water
