"""Water Linked DVLs over TCP: one JSON object a line, formats json_v1 to json_v3.x.

Beams are the transducers with id 0 to 3; velocity in x, y, z is FRD. A transducer's velocity is positive when the
vehicle moves along its beam: on a recorded A50 it fits b . v with tilt 22.5° and azimuths +135, -135, -45, +45°.
"""

import json
import math
from typing import Any

from bottomlock.io.beam_table import Account, Recording
from bottomlock.io.lines import lines_with
from bottomlock.io.rows import NAN, PLAIN, Options, Rows, raise_if_empty

NAME = "waterlinked-json"
_BEAMS = 4


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; one that names a key twice is two, with what stood between them lost."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is given twice")
    return found


_DECODER = json.JSONDecoder(object_pairs_hook=_object)
# A report that begins within a line, after one that was cut off.
_RESTARTS = ('{"time"', '{"ts"', '{"type"')
_MOST_RESTARTS = 8
LONGEST_JSON = 65_536
"""Longest line that is read as a report, bytes."""


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


def _objects(line: bytes, position: int, account: Account) -> list[dict[str, Any]]:
    """The JSON objects of a line: one, or more where line ends were lost."""
    if len(line) > LONGEST_JSON:
        account.read += 1
        account.skip("line too long", position, line)
        return []
    text = line.decode("utf-8", "replace")
    found: list[dict[str, Any]] = []
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
    account.read += len(found) + damaged
    if damaged:
        account.skip("merged line" if found else "truncated", position, line)
    elif len(found) > 1:
        account.flag("merged line, all of it read", position)
    return found


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


def _is_velocity(report: dict[str, Any], position: int, account: Account) -> bool:
    kind = report.get("type", "velocity" if {"vx", "transducers"} & report.keys() else None)
    if report.get("tracking_mode", "bottom") != "bottom" or kind == "velocity_water":
        account.pass_by("velocity through the water", position)
        return False
    if kind != "velocity":
        name = (
            kind
            if isinstance(kind, str) and kind
            else "reply"
            if "response_to" in report
            else "unknown object"
        )
        account.pass_by(name[:40], position)
        return False
    return True


def read(data: bytes, place: str, options: Options = PLAIN) -> Recording:
    """Velocity reports of a recorded stream.

    Raises:
        DataError: where there is no velocity report with transducers.
    """
    account = Account(unit="line")
    rows, clock = Rows(_BEAMS, account), _Clock(distinct=options.clock == "distinct")
    formats: dict[str, int] = {}
    before: list[tuple[Any, ...]] | None = None
    last: dict[str, Any] | None = None
    for position, line in lines_with(data, b"{", account, "truncated", LONGEST_JSON):
        for report in _objects(line, position, account):
            if not _is_velocity(report, position, account):
                continue
            time_ns = clock.time_ns(report, position, account, repeat=report == last)
            last = report
            if time_ns is None:
                continue
            beams = _transducers(report)
            if beams is None:
                account.skip("transducers are not a list with ids 0 to 3", position)
                continue
            block = [
                tuple(map(repr, (b.get("velocity"), b.get("distance"), b.get("rssi"), b.get("nsd"))))
                if b
                else ()
                for b in beams
            ]
            version = str(report.get("format", "none"))[:20]
            formats[version] = formats.get(version, 0) + 1
            _add(rows, position, time_ns, report, beams, stale=block == before, keep_stale=options.keep_stale)
            before = block
    table = rows.finish(negate=options.negate_beams)
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
        facts={"formats": dict(sorted(formats.items()))},
    )


def _add(
    rows: Rows,
    position: int,
    time_ns: int,
    report: dict[str, Any],
    beams: list[dict[str, Any] | None],
    *,
    stale: bool,
    keep_stale: bool,
) -> None:
    """A report to the table; beams that repeat the report before hold no new measurement."""
    valid = [b is not None and b.get("beam_valid") is True for b in beams]
    if None in beams:
        rows.account.flag("transducer missing", position)
    if any(b is not None and not isinstance(b.get("beam_valid"), bool) for b in beams):
        rows.account.flag("transducer without beam_valid", position)
    # All beams lost reads alike from ping to ping without being a repeat.
    stale = stale and any(valid)
    if stale:
        rows.account.flag("stale repeat", position)
        if not keep_stale:
            valid = [False] * _BEAMS
    distance = [_float(b.get("distance")) if b else NAN for b in beams]
    altitude, fom = _float(report.get("altitude")), _float(report.get("fom"))
    verdict = report.get("velocity_valid")
    rows.add(
        position,
        time_ns,
        [_float(b.get("velocity")) if b else NAN for b in beams],
        valid,
        range_m=[d if d >= 0.0 else NAN for d in distance],
        quality=[_float(b.get("rssi")) if b else NAN for b in beams],
        instrument=[_float(report.get(axis)) for axis in ("vx", "vy", "vz")],
        verdict=int(verdict) if isinstance(verdict, bool) else -1,
        stale=stale,
        extra={
            "altitude_m": altitude if altitude >= 0.0 else NAN,
            "instrument_sd_mps": fom,
            **{f"beam{k + 1}_noise_dbm": _float(b.get("nsd")) if b else NAN for k, b in enumerate(beams)},
        },
    )
