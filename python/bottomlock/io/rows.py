"""The beam table of the pings that a reader found, and the water table of its cells.

A reader gathers its pings in arrays, with the position of each; this module ensures what holds for every table: rising
times, a finite velocity where a beam is valid, and an account of every record that does not fit.
"""

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.errors import DataError
from bottomlock.io.account import in_file_order
from bottomlock.io.beam_table import NO_TIME_NS, Account, BeamTable, Flags, Floats, Integers, WaterTable
from bottomlock.io.columns import LATEST_NS

NAN = math.nan
UNSURE = "sign not confirmed on a recording: positive towards the bottom is assumed; --negate-beams turns it"
"""A note on formats that nobody has recorded beside another velocity."""


@dataclass(frozen=True)
class Options:
    """Settings of the readers; `bottomlock convert` has them as options, with these words.

    Attributes:
        columns: TOML file with the column map of a CSV or Parquet table.
        topic: Topic of a bag that holds several topics of the message.
        instrument_only: Keep records without beams, for the instrument's own velocity.
        keep_stale: Keep beams valid that repeat the previous record unchanged.
        negate_beams: Reverse the sign of beam velocities that are positive away from the bottom.
        beams_from_axes: Recover the beams of PD0 in other coordinates from solutions of four beams.
        clock: Where the clock is the sum of intervals: that of every report, or not of reports that repeat.
    """

    columns: str | None = None
    topic: str | None = None
    instrument_only: bool = False
    keep_stale: bool = False
    negate_beams: bool = False
    beams_from_axes: bool = False
    clock: Literal["reports", "distinct"] = "reports"


PLAIN = Options()

Times = Integers | Sequence[int | None]
"""Nanoseconds; a sequence may hold integers of any size, and None where there is no time."""


# Instruments also send the not-a-numbers that signal.
@np.errstate(invalid="ignore")
def make_table(
    account: Account,
    beams: int,
    position: ArrayLike,
    time_ns: Times,
    velocity: ArrayLike,
    valid: ArrayLike,
    *,
    range_m: ArrayLike | None = None,
    quality: ArrayLike | None = None,
    sd: ArrayLike | None = None,
    instrument: ArrayLike | None = None,
    verdict: ArrayLike = -1,
    arrival_ns: Times | None = None,
    stale: ArrayLike = False,
    extra: Mapping[str, ArrayLike] | None = None,
    negate: bool = False,
) -> BeamTable:
    """The table of n pings, without those whose times are out of range or break the rising order (as few as possible).

    A valid beam without a finite velocity becomes invalid and is flagged; an infinity becomes NaN.

    Args:
        account: takes the number of rows and what is left out or changed.
        beams: number of beams.
        position: (n,) of each ping in the file.
        time_ns: (n,).
        velocity: (n, beams), m/s, as `valid`, `range_m`, `quality` and `sd`.
        valid: (n, beams).
        range_m: None where the records hold none, as the following.
        quality: as `BeamTable.quality`.
        sd: m/s.
        instrument: (n, 3), m/s.
        verdict: (n,) or one for all, as `BeamTable.instrument_valid`.
        arrival_ns: (n,), None or `NO_TIME_NS` where a ping has none.
        stale: (n,) or one for all.
        extra: columns of (n,) by name.
        negate: turns the sign of the beam velocities.
    """
    where = np.asarray(position, dtype=np.int64)
    n = len(where)
    times, arrival = whole_times(time_ns), None if arrival_ns is None else whole_times(arrival_ns)
    late = np.abs(times) >= LATEST_NS
    account.skip_where("time out of range", late, where, lambda k: f"{time_ns[k]} ns")
    if arrival is not None and arrival_ns is not None:
        given, found = arrival != NO_TIME_NS, arrival_ns
        late_arrival = given & ~late & ((arrival <= -LATEST_NS) | (arrival >= LATEST_NS))
        account.flag_where("arrival time out of range", late_arrival, where, lambda k: f"{found[k]} ns")
        arrival[late_arrival] = NO_TIME_NS
    speed, good = _numbers(velocity, n, beams), np.asarray(valid, dtype=bool).reshape(n, beams)
    usable = good & np.isfinite(speed)
    wrong = (good & ~usable).any(axis=1) & ~late
    account.flag_where("valid beam without a finite velocity", wrong, where)
    keep = _rising(times, ~late, where, account)
    account.kept = len(keep)
    arrival = None if arrival is None else arrival[keep]
    return BeamTable(
        time_ns=times[keep],
        velocity_mps=(-speed if negate else speed)[keep],
        valid=usable[keep],
        range_m=_numbers(range_m, n, beams)[keep],
        quality=_numbers(quality, n, beams)[keep],
        sd_mps=_numbers(sd, n, beams)[keep],
        instrument_mps=_numbers(instrument, n, 3)[keep],
        instrument_valid=_flags(np.asarray(verdict, dtype=np.int8), keep),
        arrival_ns=None if arrival is None or (arrival == NO_TIME_NS).all() else arrival,
        stale=_flags(np.asarray(stale, dtype=bool), keep),
        extra={name: _numbers(values, n, 1)[keep, 0] for name, values in (extra or {}).items()},
    )


def _numbers(values: ArrayLike | None, n: int, width: int) -> Floats:
    """Own numbers (n, width), NaN where none are given."""
    return _finite(np.full((n, width), np.nan) if values is None else values).reshape(n, width)


def _flags(values: NDArray[Any], keep: Integers) -> NDArray[Any]:
    """The flags of the rows that are kept, from one a row or one for all."""
    return values[keep] if values.ndim else np.full(len(keep), values)


def whole_times(times: Times) -> Integers:
    """Times as an own array, `NO_TIME_NS` for None; those beyond 64 bits become `LATEST_NS`."""
    if isinstance(times, np.ndarray):
        return times.astype(np.int64)
    try:
        return np.maximum(np.minimum(np.array(times, dtype=np.int64), LATEST_NS), -LATEST_NS)
    except (TypeError, OverflowError):  # a time that is absent, or beyond 64 bits
        return np.array(
            [NO_TIME_NS if t is None else max(-LATEST_NS, min(t, LATEST_NS)) for t in times], dtype=np.int64
        )


def _rising(times: Integers, usable: Flags, position: Integers, account: Account) -> Integers:
    """Indices of the longest strictly rising run of the usable times; the others are counted."""
    chosen = usable.nonzero()[0]
    times, position = times[chosen], position[chosen]
    if len(times) < 2 or (times[1:] > times[:-1]).all():
        return chosen
    keep = np.array(longest_rising(times.tolist()), dtype=np.int64)
    left = np.ones(len(times), dtype=bool)
    left[keep] = False
    repeats = left & np.isin(times, times[keep])
    for reason, those in (("time repeats", repeats), ("time out of order", left & ~repeats)):
        account.skip_where(reason, those, position, lambda k: f"{times[k]} ns")
    return chosen[keep]


# Instruments also send the not-a-numbers that signal.
@np.errstate(invalid="ignore")
def make_water(
    account: Account,
    position: ArrayLike,
    time_ns: ArrayLike,
    cell: ArrayLike,
    range_m: ArrayLike,
    velocity: ArrayLike,
    valid: ArrayLike,
    *,
    quality: ArrayLike | None = None,
    sd: ArrayLike | None = None,
    negate: bool = False,
) -> WaterTable | None:
    """The table of n cells, sorted by time and cell; None for n = 0.

    A valid beam without a finite velocity becomes invalid and is flagged; an infinity becomes NaN. Of two cells of one
    time and number the first in the file stands, and cells whose time is out of range are left out; both are flagged.

    Args:
        account: takes what is left out or changed.
        position: (n,) of each cell's record in the file.
        time_ns: (n,).
        cell: (n,) from 1 on.
        range_m: (n,) along the beam, to the middle of the cell.
        velocity: (n, beams), m/s, of the vehicle through the water, as `valid`, `quality` and `sd`.
        valid: (n, beams).
        quality: correlation, 0 to 255; None where the records hold none.
        sd: m/s; None where the records hold none.
        negate: turns the sign of the velocities.
    """
    at, times, number = (np.asarray(one, dtype=np.int64) for one in (position, time_ns, cell))
    if not len(at):
        return None
    speed, along = _finite(velocity), _finite(range_m)
    good = np.asarray(valid, dtype=bool)
    usable = good & np.isfinite(speed) & np.isfinite(along)[:, None]
    wrong: Flags = np.asarray((good & ~usable).any(axis=1))
    account.flag_where("valid water beam without a finite velocity and range", wrong, at)
    kept = _sorted_cells(times, number, at, account)
    if not len(kept):
        return None
    none = np.full((len(kept), speed.shape[1]), np.nan)
    return WaterTable(
        time_ns=times[kept],
        cell=number[kept],
        range_m=along[kept],
        velocity_mps=(-speed if negate else speed)[kept],
        valid=usable[kept],
        quality=none if quality is None else _finite(quality)[kept],
        sd_mps=none if sd is None else _finite(sd)[kept],
    )


def _finite(values: ArrayLike) -> Floats:
    """Own numbers, NaN for what is not finite: an infinity is no measurement."""
    found = np.array(values, dtype=np.float64)
    found[~np.isfinite(found)] = np.nan
    return found


def _sorted_cells(times: Integers, number: Integers, at: Integers, account: Account) -> Integers:
    """Indices of the cells whose time is in range by time and number, without those that repeat another."""
    late = np.abs(times) >= LATEST_NS
    account.flag_where("water cells without a time in range", late, at)
    order = np.lexsort((number, times))
    order = order[~late[order]]
    repeats: Flags = np.zeros(len(at), dtype=bool)
    repeats[order[1:]] = (np.diff(times[order]) == 0) & (np.diff(number[order]) == 0)
    account.flag_where("water cells that repeat a time", repeats, at)
    return order[~repeats[order]]


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


def lost(account: Account) -> str:
    """The skipped records, as the end of a message; "" without any.

    >>> account = Account(unit="byte")
    >>> account.skip("bad checksum", 446)
    >>> lost(account)
    '; skipped: 1 bad checksum (first at byte 446)'
    """
    parts = [
        f"{reason.count} {name} (first at {account.unit} {reason.first})"
        for name, reason in in_file_order(account.skipped)
    ]
    return f"; skipped: {', '.join(parts)}" if parts else ""


def raise_if_empty(account: Account, place: str, what: str) -> None:
    """Raises an error that lists what was found instead, where a file has no ping.

    Raises:
        DataError: naming the file, and why each record was skipped.
    """
    if account.kept:
        return
    others = ", ".join(f"{reason.count} {name}" for name, reason in in_file_order(account.other))
    found = f"; there are {others}" if others else ""
    raise DataError(f"no {what} could be read{found}{lost(account)}", place=place)
