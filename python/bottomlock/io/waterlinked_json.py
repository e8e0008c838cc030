"""Water Linked DVLs over TCP: one JSON object a line, formats json_v1 to json_v3.x.

Beams are the transducers with id 0 to 3; velocity in x, y, z is FRD. A transducer's velocity is positive when the
vehicle moves along its beam: on a recorded A50 it fits b . v with tilt 22.5° and azimuths +135, -135, -45, +45°.

A report of the water (type `velocity_water`, tracking mode `water`, from json_v3.2 on) comes in place of one of the
bottom: it is a ping whose beams have no bottom, and a cell of the water.

What a capture writes before a report, as a time or the mark of a WebSocket, is left out; so is what `ros2 topic echo`
and `rostopic echo` write around a `std_msgs/String`.

Source: Water Linked, TCP JSON API of the A50 and A125, and "Water tracking".
"""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.decoder import Decoder, Format, LineDecoder, Row
from bottomlock.io.rows import NAN

# A report that begins within a line, after one that was cut off.
_RESTARTS = ('{"time"', '{"ts"', '{"type"')
_MOST_RESTARTS = 8
_PREFIX = re.compile(r"""[^"{}]{0,200}[\s\]>|:"'](?=\{)""")
"""Before a report in a capture: no part of one, and it does not end within a word."""
_SEPARATOR = b"---"
"""Between two messages of an echo."""


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; one that names a key twice is two, with what stood between them lost."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is given twice")
    return found


_DECODER = json.JSONDecoder(object_pairs_hook=_object)

Object = dict[str, Any]


def _without_capture(text: str) -> str:
    """A line without what a capture has written around its reports, with the quotes as they were sent."""
    prefix = _PREFIX.match(text)
    if prefix is None:
        return text
    text = text[prefix.end() :]
    end = prefix.group()[-1]
    if end not in {'"', "'"} or not text.endswith(end):
        return text
    text = text[:-1]
    if end == "'":
        return text.replace("''", "'")
    try:
        return str(json.loads(f'"{text}"'))
    except ValueError:
        return text


def _parse(text: str) -> tuple[list[Object], bool]:
    """The objects of a line without blanks around it, and whether there is more in it than these."""
    found: list[Object] = []
    at, restarts, damaged = 0, 0, False
    while 0 <= at < len(text):
        try:
            value, end = _DECODER.raw_decode(text, at)
        except (ValueError, RecursionError):
            damaged = True
            later = [p for p in (text.find(start, at + 1) for start in _RESTARTS) if p >= 0]
            restarts += 1
            at = min(later) if later and restarts <= _MOST_RESTARTS else -1
            continue
        if isinstance(value, dict):
            found.append(value)
        else:
            damaged = True
        at = end
        while at < len(text) and text[at] in " \t\r":
            at += 1
    return found, damaged


_BEAMS = 4
WATER_RANGE_M = 3.0 / math.cos(math.radians(22.5))
"""Along the beam to the middle of the layer of water that the instrument measures, 1.5 m to 4.5 m below it."""


def _float(value: object) -> float:
    """A JSON number; NaN for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return NAN
    try:
        return float(value)
    except OverflowError:
        return NAN


def _transducers(report: dict[str, Any]) -> list[dict[str, Any] | None] | None:
    """The transducers by id; None where they are no list of objects with ids 0 to 3."""
    listed = report.get("transducers")
    if not isinstance(listed, list):
        return None
    by_id: list[dict[str, Any] | None] = [None] * _BEAMS
    for one in listed:
        if not isinstance(one, dict):
            return None
        k = one.get("id")
        if isinstance(k, bool) or not isinstance(k, int) or not 0 <= k < _BEAMS or by_id[k] is not None:
            return None
        by_id[k] = one
    return by_id


class _Clock:
    """Time of validity where reports carry it; else the sum of the intervals, as json_v1 has no clock.

    Attributes:
        sum_ns: sum of the intervals of the reports so far; with `distinct`, of those that do not repeat another.
        repeats: reports that repeat the one before, byte for byte.
        repeated_ns: sum of their intervals.
        absolute: reports carry the time of validity; None before the first.
    """

    def __init__(self, *, distinct: bool) -> None:
        self.distinct = distinct
        self.sum_ns = self.repeats = self.repeated_ns = 0
        self.absolute: bool | None = None

    def time_ns(self, report: dict[str, Any], position: int, account: Account, *, repeat: bool) -> int | None:
        step_ms = _float(report.get("time"))
        usable = math.isfinite(step_ms) and 0.0 <= step_ms < 1e9
        step_ns = round(step_ms * 1e6) if usable else 0
        if repeat:
            self.repeats += 1
            self.repeated_ns += step_ns
        if not (repeat and self.distinct):
            self.sum_ns += step_ns
        validity = report.get("time_of_validity")
        given = isinstance(validity, int) and not isinstance(validity, bool) and validity > 0
        if self.absolute is None and (given or usable):
            self.absolute = given
        if self.absolute:
            if given:
                return int(validity) * 1000  # type: ignore[arg-type]
            account.skip("no time of validity", position)
            return None
        if not usable:
            account.skip("no interval since the last report", position)
            return None
        if repeat and self.distinct:
            account.skip("repeats the report before", position)
            return None
        return self.sum_ns

    def notes(self, account: Account) -> list[str]:
        """What the user has to know of a clock that is a sum."""
        if self.absolute:
            return []
        notes = ["the reports carry no clock: time is the sum of their intervals, and starts at zero"]
        if self.repeats:
            without = self.sum_ns if self.distinct else self.sum_ns - self.repeated_ns
            notes.append(
                f"{self.repeats} reports repeat the one before byte for byte, interval included: the intervals sum to "
                f"{(without + self.repeated_ns) * 1e-9:.1f} s with them (--clock reports) and {without * 1e-9:.1f} s "
                "without (--clock distinct); this table has the " + ("second" if self.distinct else "first")
            )
        if account.skipped.keys() - {"repeats the report before"}:
            notes.append("the intervals of unreadable reports are missing from that sum")
        return notes


def _of_water(report: dict[str, Any]) -> bool:
    """Whether a report is one of the velocity through the water."""
    mode = report.get("tracking_mode", "bottom")
    return report.get("type") == "velocity_water" or (mode == "water" and report.get("type") == "velocity")


def _other(report: dict[str, Any]) -> str | None:
    """The kind of an object that is no velocity, None for one that is, over ground or through the water."""
    if _of_water(report):
        return None
    kind = report.get("type")
    if kind is None and "type" not in report and ("vx" in report or "transducers" in report):
        kind = "velocity"
    if report.get("tracking_mode", "bottom") != "bottom":
        return "velocity in an unknown tracking mode"
    if kind == "velocity":
        return None
    if isinstance(kind, str) and kind:
        return kind[:40]
    return "reply" if "response_to" in report else "unknown object"


_OF_BEAM = ("velocity", "distance", "rssi", "nsd")
_OF_REPORT = ("vx", "vy", "vz", "altitude", "fom")


def row_of(
    position: int,
    time_ns: int,
    beams: Sequence[Sequence[float]],
    own: Sequence[float],
    sent_ns: int | None,
    *,
    through_water: bool,
) -> Row:
    """The row of a report, whose beams are valid where they have a distance.

    Args:
        position, time_ns, sent_ns: as of `Row`.
        beams: of each velocity, distance, signal strength and noise.
        own: the instrument's velocity, altitude and figure of merit.
        through_water: the report is one of the water.
    """
    velocity, distance, rssi, noise = map(list, zip(*beams, strict=True))
    *axes, altitude, fom = own
    noises = {f"beam{k + 1}_noise_dbm": one for k, one in enumerate(noise)}
    return Row(
        position=position,
        time_ns=time_ns,
        velocity=velocity,
        valid=[one >= 0.0 for one in distance],
        range_m=[one if one >= 0.0 else NAN for one in distance],
        quality=rssi,
        instrument=axes,
        extra={"altitude_m": altitude if altitude >= 0.0 else NAN, "instrument_sd_mps": fom, **noises},
        sent_ns=sent_ns,
        water_m=WATER_RANGE_M if through_water else None,
    )


class ReportDecoder(Decoder):
    """Velocity reports of a stream or of a driver's messages.

    Attributes:
        formats: how many reports there are of each version.
    """

    frame = "frd"

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self.formats: dict[str, int] = {}

    def report(self, position: int, time_ns: int, report: Object, sent_ns: int | None = None) -> None:
        """Takes a report; beams that repeat the report before hold no new measurement."""
        account, beams = self.account, _transducers(report)
        if beams is None:
            account.skip("transducers are not a list with ids 0 to 3", position)
            return
        if len({frozenset(beam) for beam in beams if beam}) > 1:
            # Bytes lost from one number to another leave whole JSON without a field.
            account.skip("transducers with different fields", position)
            return
        if 0 < len(report.keys() & _OF_REPORT) < len(_OF_REPORT):
            account.skip("velocity without one of its fields", position)
            return
        version = str(report.get("format", "none"))[:20]
        self.formats[version] = self.formats.get(version, 0) + 1
        said = [None if b is None else b.get("beam_valid") for b in beams]
        valid = [one is True for one in said]
        if None in beams:
            account.flag("transducer missing", position)
        if any(b is not None and not isinstance(one, bool) for b, one in zip(beams, said, strict=True)):
            account.flag("transducer without beam_valid", position)
        block = [tuple(map(b.get, _OF_BEAM)) if b else () for b in beams]
        valid, stale = self.fresh(position, block, valid)
        verdict = report.get("velocity_valid")
        through_water = _of_water(report)
        if through_water:
            account.flag("velocity through the water: no beam has the bottom", position)
        beams_of = [[_float(value) for value in one or _NONE] for one in block]
        lost = [one and v == 0.0 and m <= 0.0 for one, (v, m, *_) in zip(valid, beams_of, strict=True)]
        if any(lost):
            account.flag("velocity is a code for no reading", position)
            valid = [one and not none for one, none in zip(valid, lost, strict=True)]
        own = [_float(report.get(name)) for name in _OF_REPORT]
        row = row_of(position, time_ns, beams_of, own, sent_ns, through_water=through_water)
        row.valid, row.stale = valid, stale
        row.verdict = int(verdict) if isinstance(verdict, bool) else -1
        self.rows.append(row)


_NONE = (None,) * len(_OF_BEAM)


class _Decoder(LineDecoder, ReportDecoder):
    """An object a line."""

    longest = 65_536

    def __post_init__(self) -> None:
        """Begins."""
        super().__post_init__()
        self._clock = _Clock(distinct=self.options.clock == "distinct")
        self._last: Object | None = None

    def line(self, position: int, line: bytes) -> None:
        """Takes the objects of a line."""
        account = self.account
        if line == _SEPARATOR:
            account.read += 1
            account.pass_by("end of a message", position)
            return
        found, damaged = _parse(_without_capture(line.decode("utf-8", "replace")))
        account.read += len(found) + damaged
        if damaged:
            account.skip("merged line" if found else "truncated", position, line)
        elif len(found) > 1:
            account.flag("merged line, all of it read", position)
        for one in found:
            kind = _other(one)
            if kind is not None:
                account.pass_by(kind, position)
                continue
            time_ns = self._clock.time_ns(one, position, account, repeat=one == self._last)
            self._last = one
            if time_ns is not None:
                sent = one.get("time_of_transmission")
                sent_ns = sent * 1000 if self._clock.absolute and type(sent) is int and sent >= 0 else None
                self.report(position, time_ns, one, sent_ns)

    def recording(self) -> Recording:
        """The table, as `Decoder.recording`."""
        absolute = bool(self._clock.absolute)
        return replace(
            self.tables("velocity report with transducers", _BEAMS),
            clock="the instrument's, microseconds since 1970 where it is set"
            if absolute
            else "sum of intervals",
            time_of="validity" if absolute else "record",
            quality="signal strength rssi as recorded (dBm from json_v2 on)",
            geometry="waterlinked_a50",
            notes=self._clock.notes(self.account),
            facts={"formats": dict(sorted(self.formats.items()))},
        )


def _sniff(head: bytes) -> bool:
    head = head.replace(b'\\"', b'"')
    return b'"transducers"' in head or (b'"format":"json_v' in head.replace(b" ", b"") and b'"vx"' in head)


FORMAT = Format("waterlinked-json", "Water Linked TCP, JSON v1 to v3", _sniff, _Decoder)
