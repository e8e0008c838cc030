"""Times of the rows of a table on the case's clock, and what is wrong with them: repeats, steps back, gaps, jumps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.replay.stream_sections import Clock

MEDIANS_OF_A_GAP = 3.0
"""A step of more than so many median steps is a gap, where the case does not say how long one is."""


@dataclass(frozen=True)
class Fault:
    """How often something is wrong with the rows of a stream, and where first (row of the file, from 0)."""

    count: int = 0
    row: int | None = None
    time_s: float | None = None
    longest_s: float | None = None

    @property
    def words(self) -> str:
        """For people."""
        if not self.count:
            return "none"
        where = f"{self.count}, first at row {self.row}"
        where += "" if self.time_s is None else f", {self.time_s:.3f} s"
        return where if self.longest_s is None else f"{where}, longest {self.longest_s:.3g} s"


@dataclass(frozen=True)
class ClockReport:
    """What was found of a stream's rows and times; times in seconds on the case's clock.

    Attributes:
        rows: in the file.
        kept: of them, used.
        first_s, last_s: times of the first and last kept row.
        median_step_s: between kept rows; 0 for a single one.
        repeats: rows that repeat the time before them.
        backward: rows that go back behind a time that was already there.
        gaps: steps longer than `gap_s`.
        jumps: steps longer than `jump_s`: the clock was set, or the log begins anew.
        empty: rows without the numbers that they should hold.
        strays_s: for rows at an even rate with stamps, how far the stamps lie from it at most; else None.
        gap_s: what counts as a gap.
    """

    rows: int
    kept: int
    first_s: float
    last_s: float
    median_step_s: float
    repeats: Fault
    backward: Fault
    gaps: Fault
    jumps: Fault
    empty: Fault = Fault()
    strays_s: float | None = None
    gap_s: float = 0.0

    @property
    def faultless(self) -> bool:
        """Whether there is nothing to tell."""
        return not any(f.count for f in (self.repeats, self.backward, self.gaps, self.jumps, self.empty))


@dataclass(frozen=True, eq=False)
class Timed:
    """Rows that are kept, in the order of the file, with their times."""

    rows: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    report: ClockReport


def row_times(stamps_ns: NDArray[np.int64] | None, rows: int, clock: Clock, *, place: str) -> Timed:
    """Times of the rows on the case's clock.

    Args:
        stamps_ns: (rows,) integer nanoseconds of the column, or None where the clock names none.
        rows: number of rows.
        clock: as the case states it.
        place: file, for errors.

    Raises:
        DataError: naming row and time, for rows that repeat a time or go back where they are not declared to be
        dropped,
            and for stamps that stray from an even rate by more than was declared.
    """
    strays = None
    if clock.rate_hz is not None:
        even = np.round(np.arange(rows) * (1e9 / clock.rate_hz)).astype(np.int64)
        if stamps_ns is None:
            times = even + round(clock.start_s * 1e9)
        else:
            times, strays = _even_through(stamps_ns, even, clock, place)
    else:
        assert stamps_ns is not None  # the section demands one of the two
        times = stamps_ns
    times = times + round(clock.offset_s * 1e9)
    kept, repeats, backward = _rising(times, clock, place)
    time_ns = times[kept]
    steps_s = np.diff(time_ns) * 1e-9
    median = float(np.median(steps_s)) if steps_s.size else 0.0
    gap_s = MEDIANS_OF_A_GAP * median if clock.gap_s is None else clock.gap_s
    report = ClockReport(
        rows=rows,
        kept=len(kept),
        first_s=float(time_ns[0]) * 1e-9,
        last_s=float(time_ns[-1]) * 1e-9,
        median_step_s=median,
        repeats=repeats,
        backward=backward,
        gaps=_long_steps(steps_s, kept, time_ns, gap_s, clock.jump_s),
        jumps=_long_steps(steps_s, kept, time_ns, clock.jump_s, np.inf),
        strays_s=strays,
        gap_s=gap_s,
    )
    return Timed(kept, time_ns, report)


def _even_through(
    stamps_ns: NDArray[np.int64], even: NDArray[np.int64], clock: Clock, place: str
) -> tuple[NDArray[np.int64], float]:
    """Even times through a host's stamps: their median delay is taken for the delay of every row."""
    delay = stamps_ns - even
    first = int(np.median(delay))
    stray = np.abs(delay - first)
    worst = int(np.argmax(stray))
    if stray[worst] > round(clock.steady_within_s * 1e9):
        raise DataError(
            f"{place}: row {worst} is stamped {(delay[worst] - first) * 1e-9:+.4f} s off an even rate of "
            f"{clock.rate_hz:g} Hz, expected within clock.steady_within_s = {clock.steady_within_s:g} s: rows are "
            "missing, or the rate is another"
        )
    return even + first, float(stray[worst]) * 1e-9


def _rising(times: NDArray[np.int64], clock: Clock, place: str) -> tuple[NDArray[np.int64], Fault, Fault]:
    """Rows whose time is later than every one before; the others counted, or refused."""
    before = np.maximum.accumulate(times)[:-1]
    rises = np.concatenate([[True], times[1:] > before])
    late = np.flatnonzero(~rises)
    same = late[times[late] == before[late - 1]]
    back = late[times[late] < before[late - 1]]
    if late.size and clock.unordered == "refuse":
        row = int(late[0])
        what = (
            "repeats the time before it" if row in same else f"goes back from {before[row - 1] * 1e-9:.6f} s"
        )
        raise DataError(
            f"{place}: row {row}, {times[row] * 1e-9:.6f} s, {what} ({same.size} rows repeat a time, {back.size} go "
            'back); clock.unordered = "drop" leaves such rows out'
        )
    return np.flatnonzero(rises), _fault(same, times), _fault(back, times)


def _fault(rows: NDArray[np.int64], times: NDArray[np.int64]) -> Fault:
    if not rows.size:
        return Fault()
    return Fault(int(rows.size), int(rows[0]), float(times[rows[0]]) * 1e-9)


def _long_steps(
    steps_s: NDArray[np.float64],
    rows: NDArray[np.int64],
    time_ns: NDArray[np.int64],
    longer_s: float,
    until_s: float,
) -> Fault:
    """Steps between two lengths, told by the row after them."""
    found = np.flatnonzero((steps_s > longer_s) & (steps_s <= until_s))
    if not found.size:
        return Fault()
    first = int(found[0])
    return Fault(
        int(found.size), int(rows[first + 1]), float(time_ns[first + 1]) * 1e-9, float(steps_s[found].max())
    )
