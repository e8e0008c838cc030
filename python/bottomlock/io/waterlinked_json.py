"""Water Linked DVLs over TCP: one JSON object a line, formats json_v1 to json_v3.x.

Beams are the transducers with id 0 to 3; velocity in x, y, z is FRD. A transducer's velocity is positive when the
vehicle moves along its beam: on a recorded A50 it fits b . v with tilt 22.5° and azimuths +135, -135, -45, +45°.

A report of the water (type `velocity_water`, tracking mode `water`, from json_v3.2 on) comes in place of one of the
bottom: it is a ping whose beams have no bottom, and a cell of the water.

Source: Water Linked, TCP JSON API of the A50 and A125, and "Water tracking".
"""

import contextlib
import json
import math
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from bottomlock.io.beam_table import Account, BeamTable, Floats, Recording, WaterTable
from bottomlock.io.framing import Lines, Stream
from bottomlock.io.rows import NAN, PLAIN, Options, make_table, make_water, raise_if_empty, whole_times
from bottomlock.io.sentences import lines_of

LONGEST_JSON = 65_536
"""Longest line that is read as a report, bytes."""
# A report that begins within a line, after one that was cut off.
_RESTARTS = ('{"time"', '{"ts"', '{"type"')
_MOST_RESTARTS = 8


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; one that names a key twice is two, with what stood between them lost."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is given twice")
    return found


_DECODER = json.JSONDecoder(object_pairs_hook=_object)

Object = dict[str, Any]


def objects(
    data: bytes, other: Callable[[Object], str | None], account: Account
) -> Iterator[tuple[int, Object]]:
    """The objects of a file, with the number of their line; what else there is goes to the account.

    Args:
        data: the file.
        other: the kind of an object that is passed by, None for one that is wanted.
        account: for the counts.
    """
    for position, line in lines_of(data):
        account.read += 1
        if len(line) > LONGEST_JSON:
            account.skip("line too long", position, line)
            continue
        found, damaged = _parse(line.decode("utf-8", "replace"))
        account.read += len(found) + damaged - 1
        if damaged:
            account.skip("merged line" if found else "truncated", position, line)
        elif len(found) > 1:
            account.flag("merged line, all of it read", position)
        for one in found:
            kind = other(one)
            if kind is None:
                yield position, one
            else:
                account.pass_by(kind, position)


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


NAME = "waterlinked-json"
STREAM = Stream(
    lambda _: Lines(LONGEST_JSON),
    transmission=re.compile(rb'"time_of_transmission"\s{0,4}:\s{0,4}([0-9]{1,18})'),
    repeats=True,
    sums=True,
)
_BEAMS = 4
WATER_RANGE_M = 3.0 / math.cos(math.radians(22.5))
"""Along the beam to the middle of the layer of water that the instrument measures, 1.5 m to 4.5 m below it."""


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like this format."""
    return b'"transducers"' in head or (b'"format":"json_v' in head.replace(b" ", b"") and b'"vx"' in head)


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


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Velocity reports of a recorded stream.

    Raises:
        DataError: where there is no velocity report with transducers.
    """
    account = Account(unit="line")
    reports, clock = (
        Reports(account, keep_stale=options.keep_stale),
        _Clock(distinct=options.clock == "distinct"),
    )
    last: dict[str, Any] | None = None
    for position, report in objects(data, _other, account):
        time_ns = clock.time_ns(report, position, account, repeat=report == last)
        last = report
        if time_ns is not None:
            reports.add(position, time_ns, report)
    table, water = reports.table(negate=options.negate_beams), reports.water(negate=options.negate_beams)
    raise_if_empty(account, place, "velocity report with transducers")
    absolute = bool(clock.absolute)
    return Recording(
        format=NAME,
        table=table,
        account=account,
        frame="frd",
        clock="the instrument's, microseconds since 1970 where it is set" if absolute else "sum of intervals",
        time_of="validity" if absolute else "record",
        quality="signal strength rssi as recorded (dBm from json_v2 on)",
        geometry="waterlinked_a50",
        notes=clock.notes(account),
        facts={"formats": dict(sorted(reports.formats.items()))},
        water=water,
    )


class Reports:
    """Velocity reports of a stream or of a driver's messages, their numbers as they stand until `table`.

    Attributes:
        formats: how many reports there are of each version.
    """

    def __init__(self, account: Account, *, keep_stale: bool) -> None:
        self.formats: dict[str, int] = {}
        self._account, self._keep_stale = account, keep_stale
        self._position: list[int] = []
        self._time_ns: list[int] = []
        self._numbers: list[object] = []
        self._valid: list[list[bool]] = []
        self._verdict: list[int] = []
        self._stale: list[bool] = []
        self._through_water: list[bool] = []
        self._before: list[tuple[Any, ...]] | None = None

    def add(self, position: int, time_ns: int, report: dict[str, Any]) -> None:
        """Takes a report; beams that repeat the report before hold no new measurement."""
        beams = _transducers(report)
        if beams is None:
            self._account.skip("transducers are not a list with ids 0 to 3", position)
            return
        if len({frozenset(beam) for beam in beams if beam}) > 1:
            # Bytes lost from one number to another leave whole JSON without a field.
            self._account.skip("transducers with different fields", position)
            return
        if 0 < len(report.keys() & _OF_REPORT) < len(_OF_REPORT):
            self._account.skip("velocity without one of its fields", position)
            return
        version = str(report.get("format", "none"))[:20]
        self.formats[version] = self.formats.get(version, 0) + 1
        said = [None if b is None else b.get("beam_valid") for b in beams]
        valid = [one is True for one in said]
        if None in beams:
            self._account.flag("transducer missing", position)
        if any(b is not None and not isinstance(one, bool) for b, one in zip(beams, said, strict=True)):
            self._account.flag("transducer without beam_valid", position)
        block = [tuple(map(b.get, _OF_BEAM)) if b else () for b in beams]
        # All beams lost reads alike from ping to ping without being a repeat; nor is 1 the same record as 1.0.
        stale = any(valid) and block == self._before and repr(block) == repr(self._before)
        self._before = block
        if stale:
            self._account.flag("stale repeat", position)
            if not self._keep_stale:
                valid = [False] * _BEAMS
        verdict = report.get("velocity_valid")
        through_water = _of_water(report)
        if through_water:
            self._account.flag("velocity through the water: no beam has the bottom", position)
            verdict = False
        self._position.append(position)
        self._time_ns.append(time_ns)
        for numbers in block:
            self._numbers += numbers or _NONE
        self._numbers += map(report.get, _OF_REPORT)
        self._valid.append(valid)
        self._through_water.append(through_water)
        self._verdict.append(int(verdict) if isinstance(verdict, bool) else -1)
        self._stale.append(stale)

    def table(self, *, negate: bool) -> BeamTable:
        """The table; a report of the water has nothing of the bottom."""
        through_water = np.array(self._through_water, dtype=bool)[:, None]
        values = np.where(through_water, NAN, self._values)
        velocity, distance, rssi, noise = (values[:, k : 4 * _BEAMS : 4] for k in range(len(_OF_BEAM)))
        altitude, fom = values[:, -2], values[:, -1]
        return make_table(
            self._account,
            _BEAMS,
            self._position,
            self._time_ns,
            velocity,
            np.array(self._valid, dtype=bool).reshape(-1, _BEAMS) & ~through_water,
            range_m=np.where(distance >= 0.0, distance, NAN),
            quality=rssi,
            instrument=values[:, -5:-2],
            verdict=self._verdict,
            stale=self._stale,
            extra={
                "altitude_m": np.where(altitude >= 0.0, altitude, NAN),
                "instrument_sd_mps": fom,
                **{f"beam{k + 1}_noise_dbm": noise[:, k] for k in range(_BEAMS)},
            },
            negate=negate,
        )

    def water(self, *, negate: bool) -> WaterTable | None:
        """The layer of the water of each of its reports, as cell 1."""
        mine = np.flatnonzero(self._through_water)
        return make_water(
            self._account,
            np.array(self._position, dtype=np.int64)[mine],
            whole_times(self._time_ns)[mine],
            np.ones(len(mine)),
            np.full(len(mine), WATER_RANGE_M),
            self._values[mine, 0 : 4 * _BEAMS : 4],
            np.array(self._valid, dtype=bool).reshape(-1, _BEAMS)[mine],
            negate=negate,
        )

    @property
    def _values(self) -> Floats:
        """(n, numbers) of every report: of each beam, then of the report itself."""
        return _floats(self._numbers).reshape(-1, _BEAMS * len(_OF_BEAM) + len(_OF_REPORT))


_OF_BEAM = ("velocity", "distance", "rssi", "nsd")
_OF_REPORT = ("vx", "vy", "vz", "altitude", "fom")
_NONE = (None,) * len(_OF_BEAM)
_NUMBERS = {int, float, type(None)}


def _floats(values: list[object]) -> Floats:
    """JSON values as `_float`."""
    if set(map(type, values)) <= _NUMBERS:
        with contextlib.suppress(OverflowError):
            return np.array(values, dtype=np.float64)
    return np.array([_float(value) for value in values])
