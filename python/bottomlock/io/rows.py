"""Collects the pings of a reader in a beam table.

A reader adds each record with its position; this module ensures what holds for every table: rising times, a finite
velocity where a beam is valid, and an account of every record that does not fit.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.beam_table import NO_TIME_NS, Account, BeamTable, Floats
from bottomlock.io.columns import LATEST_NS

NAN = math.nan


@dataclass(frozen=True)
class Options:
    """Settings of the readers.

    Attributes:
        instrument_only: accept records without beam velocities, for the instrument's own velocity.
        keep_stale: keep beams valid that repeat the record before.
        negate_beams: beam velocities are positive away from the bottom in this file.
        ignore_checksum: keep text records whose checksum does not fit, flagged.
        clock: of a sum of intervals: "reports" adds that of every report, "distinct" not those of exact repeats.
        topic: of a bag or MCAP file with several.
        columns: TOML file with the column map of a table.
    """

    instrument_only: bool = False
    keep_stale: bool = False
    negate_beams: bool = False
    ignore_checksum: bool = False
    clock: Literal["reports", "distinct"] = "reports"
    topic: str | None = None
    columns: str | None = None


PLAIN = Options()


@dataclass
class Rows:
    """Rows of a table under construction: `add` appends a ping, `finish` returns the table."""

    beams: int
    account: Account
    time_ns: list[int] = field(default_factory=list)
    position: list[int] = field(default_factory=list)
    velocity: list[Sequence[float]] = field(default_factory=list)
    valid: list[Sequence[bool]] = field(default_factory=list)
    range_m: list[Sequence[float]] = field(default_factory=list)
    quality: list[Sequence[float]] = field(default_factory=list)
    sd: list[Sequence[float]] = field(default_factory=list)
    instrument: list[Sequence[float]] = field(default_factory=list)
    verdict: list[int] = field(default_factory=list)
    arrival_ns: list[int | None] = field(default_factory=list)
    stale: list[bool] = field(default_factory=list)
    extra: dict[str, list[float]] = field(default_factory=dict)

    def add(
        self,
        position: int,
        time_ns: int,
        velocity: Sequence[float],
        valid: Sequence[bool],
        *,
        range_m: Sequence[float] | None = None,
        quality: Sequence[float] | None = None,
        sd: Sequence[float] | None = None,
        instrument: Sequence[float] = (NAN, NAN, NAN),
        verdict: int = -1,
        arrival_ns: int | None = None,
        stale: bool = False,
        extra: dict[str, float] | None = None,
    ) -> None:
        """Appends a ping; a valid beam without a finite velocity becomes invalid and is flagged in the account."""
        if not -LATEST_NS < time_ns < LATEST_NS:
            self.account.skip("time out of range", position, f"{time_ns} ns")
            return
        if arrival_ns is not None and not -LATEST_NS < arrival_ns < LATEST_NS:
            self.account.flag("arrival time out of range", position, f"{arrival_ns} ns")
            arrival_ns = None
        if any(good and not math.isfinite(v) for v, good in zip(velocity, valid, strict=True)):
            self.account.flag("valid beam without a finite velocity", position)
            valid = [good and math.isfinite(v) for v, good in zip(velocity, valid, strict=True)]
        none = (NAN,) * self.beams
        self.position.append(position)
        self.time_ns.append(time_ns)
        self.velocity.append(velocity)
        self.valid.append(valid)
        self.range_m.append(none if range_m is None else range_m)
        self.quality.append(none if quality is None else quality)
        self.sd.append(none if sd is None else sd)
        self.instrument.append(instrument)
        self.verdict.append(verdict)
        self.arrival_ns.append(arrival_ns)
        self.stale.append(stale)
        for name, value in (extra or {}).items():
            column = self.extra.setdefault(name, [])
            column.extend([NAN] * (len(self.time_ns) - 1 - len(column)))
            column.append(value)

    def finish(self, *, negate: bool = False) -> BeamTable:
        """The table, without the rows that break the rising order of times (as few as possible)."""
        keep = self._rising()
        self.account.kept = len(keep)
        if not keep:
            return _empty(self.beams)
        n = len(self.time_ns)

        def pick(values: Sequence[Any]) -> Sequence[Any]:
            return values if len(keep) == n else [values[k] for k in keep]

        def floats(values: Sequence[Sequence[float]], width: int) -> Floats:
            array = np.array(pick(values), dtype=np.float64).reshape(len(keep), width)
            # An infinity is no measurement either: the table holds finite numbers or NaN.
            return np.where(np.isfinite(array), array, np.nan)

        arrival = pick(self.arrival_ns)
        velocity = floats(self.velocity, self.beams)
        return BeamTable(
            time_ns=np.array(pick(self.time_ns), dtype=np.int64),
            velocity_mps=-velocity if negate else velocity,
            valid=np.array(pick(self.valid), dtype=bool).reshape(len(keep), self.beams),
            range_m=floats(self.range_m, self.beams),
            quality=floats(self.quality, self.beams),
            sd_mps=floats(self.sd, self.beams),
            instrument_mps=floats(self.instrument, 3),
            instrument_valid=np.array(pick(self.verdict), dtype=np.int8),
            arrival_ns=None
            if all(t is None for t in arrival)
            else np.array([NO_TIME_NS if t is None else t for t in arrival], dtype=np.int64),
            stale=np.array(pick(self.stale), dtype=bool),
            extra={
                name: floats([(v,) for v in (*column, *([NAN] * (n - len(column))))], 1)[:, 0]
                for name, column in self.extra.items()
            },
        )

    def _rising(self) -> Sequence[int]:
        """Indices of the longest strictly rising run of times; the others are counted."""
        times = self.time_ns
        if all(a < b for a, b in pairwise(times)):
            return range(len(times))
        keep = longest_rising(times)
        kept = set(keep)
        standing = {times[k] for k in keep}
        for k, time in enumerate(times):
            if k not in kept:
                reason = "time repeats" if time in standing else "time out of order"
                self.account.skip(reason, self.position[k], f"{time} ns")
        return keep


def _empty(beams: int) -> BeamTable:
    """A table without rows."""
    none = np.empty((0, beams))
    return BeamTable(
        time_ns=np.empty(0, dtype=np.int64),
        velocity_mps=none,
        valid=np.empty((0, beams), dtype=bool),
        range_m=none,
        quality=none,
        sd_mps=none,
        instrument_mps=np.empty((0, 3)),
        instrument_valid=np.empty(0, dtype=np.int8),
    )


def longest_rising(times: Sequence[int]) -> list[int]:
    """Indices of a longest strictly rising subsequence (patience sorting, n log n).

    One wrong time in the future then loses its own row, not all that follow.

    >>> longest_rising([1, 2, 99, 3, 3, 4])
    [0, 1, 3, 5]
    """
    tails: list[int] = []  # least time that ends a rising run of each length
    ends: list[int] = []  # and its index
    before = [-1] * len(times)
    for k, time in enumerate(times):
        place = bisect_left(tails, time)
        if place < len(tails) and tails[place] == time:
            continue  # the first of equal times stands
        before[k] = ends[place - 1] if place else -1
        tails[place : place + 1] = [time]
        ends[place : place + 1] = [k]
    found = []
    k = ends[-1] if ends else -1
    while k >= 0:
        found.append(k)
        k = before[k]
    return found[::-1]


def running_sums(data: bytes) -> NDArray[np.uint16]:
    """Sums of all bytes before each place, modulo 65536: a 16-bit checksum of any piece is then two look-ups.

    Each byte is summed once, however many false headers a file has.
    """
    sums = np.zeros(len(data) + 1, dtype=np.uint16)
    np.cumsum(np.frombuffer(data, dtype=np.uint8), dtype=np.uint16, out=sums[1:])
    return sums


def lost(account: Account) -> str:
    """The skipped records, as the end of a message; "" without any.

    >>> account = Account(unit="byte")
    >>> account.skip("bad checksum", 446)
    >>> lost(account)
    '; skipped: 1 bad checksum (first at byte 446)'
    """
    parts = [
        f"{reason.count} {name} (first at {account.unit} {reason.first})"
        for name, reason in account.skipped.items()
    ]
    return f"; skipped: {', '.join(parts)}" if parts else ""


def raise_if_empty(account: Account, place: str, what: str) -> None:
    """Raises an error that lists what was found instead, where a file has no ping.

    Raises:
        DataError: naming the file, and why each record was skipped.
    """
    if account.kept:
        return
    others = ", ".join(f"{reason.count} {name}" for name, reason in account.other.items())
    found = f"; there are {others}" if others else ""
    raise DataError(f"{place}: no {what} could be read{found}{lost(account)}")
