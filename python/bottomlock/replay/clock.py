"""Times of a table's rows on the case's clock, and their faults: repeats, steps back, gaps, jumps."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.recordings.stream_sections import Clock, ImuFromAttitude, ImuStream

MEDIANS_OF_A_GAP = 3.0
"""A step longer than this many median steps is a gap, unless the case sets `gap_s`."""


@dataclass(frozen=True)
class Fault:
    """Count of one kind of fault in a stream, and where it first occurs (row of the file, from 0)."""

    count: int = 0
    row: int | None = None
    time_s: float | None = None
    longest_s: float | None = None

    @property
    def text(self) -> str:
        """Count, first row and time, longest step, for reports."""
        if not self.count:
            return "none"
        where = f"{self.count}, first at row {self.row}"
        where += "" if self.time_s is None else f", {self.time_s:.3f} s"
        return where if self.longest_s is None else f"{where}, longest {self.longest_s:.3g} s"


@dataclass(frozen=True)
class ClockReport:
    """Statistics and faults of a stream's times, s on the case's clock.

    Attributes:
        rows: number of rows in the file.
        kept: number of rows used.
        first_s, last_s: times of the first and last row used.
        median_step_s: between rows used; 0 for a single row.
        repeats: rows with the time of an earlier row.
        backward: rows earlier than a row before them.
        gaps: steps longer than `gap_s`.
        jumps: steps longer than `jump_s`: the clock was set, or the log was restarted.
        empty: rows without a number in a needed column.
        max_stamp_deviation_s: greatest deviation of the stamps from an even rate; None without both.
        gap_s: the least step that counts as a gap.
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
    max_stamp_deviation_s: float | None = None
    gap_s: float = 0.0

    def refuse_long_gap(self, section: ImuStream | ImuFromAttitude, place: str, bridge: str) -> None:
        """Checks that no gap of the readings, or of what they are made from, is longer than its section bridges.

        Raises:
            DataError: for one that is, unless its uncertainty is added; `bridge` says how it would be bridged.
        """
        longest_s = max((fault.longest_s or 0.0) for fault in (self.gaps, self.jumps))
        if longest_s > section.bridge_gaps_s and section.limits.gap == "refuse":
            fault = self.jumps if self.jumps.count else self.gaps
            raise DataError(
                f"the longest gap is {longest_s:.4g} s (steps over {self.gap_s:.4g} s: {fault.text})",
                place=place,
                expected=f"none longer than imu.bridge_gaps_s = {section.bridge_gaps_s:g} s",
                hint=f"set it to bridge the gap by {bridge}",
            )

    def to_json(self) -> dict[str, Any]:
        """Numbers as they are, and faults in words."""
        return {key: value.text if isinstance(value, Fault) else value for key, value in vars(self).items()}


@dataclass(frozen=True, eq=False)
class TimedRows:
    """Rows used (n,), in the order of the file, and their times (n,)."""

    rows: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    report: ClockReport


def row_times(stamps_ns: NDArray[np.int64] | None, rows: int, clock: Clock, *, place: str) -> TimedRows:
    """Computes the times of a table's rows on the case's clock.

    Args:
        stamps_ns: (rows,) integer nanoseconds of the time column, or None where the clock names none.
        rows: number of rows.
        clock: section of the case.
        place: file name, for errors.

    Raises:
        DataError: naming row and time, for a time that repeats or goes back unless `unordered` is "drop", and for
            stamps that deviate from an even rate by more than `steady_within_s`.
    """
    deviation_s = None
    if clock.rate_hz is not None:
        even = np.round(np.arange(rows) * (1e9 / clock.rate_hz)).astype(np.int64)
        if stamps_ns is None:
            times = even + round(clock.start_s * 1e9)
        else:
            times, deviation_s = _even_rate_times(stamps_ns, even, clock, place)
    else:
        assert stamps_ns is not None  # validated in Clock
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
        gaps=_long_steps(steps_s, kept, times, gap_s, clock.jump_s),
        jumps=_long_steps(steps_s, kept, times, clock.jump_s, np.inf),
        max_stamp_deviation_s=deviation_s,
        gap_s=gap_s,
    )
    return TimedRows(kept, time_ns, report)


def _even_rate_times(
    stamps_ns: NDArray[np.int64], even: NDArray[np.int64], clock: Clock, place: str
) -> tuple[NDArray[np.int64], float]:
    """Times at an even rate, offset by the median delay of the stamps, and the stamps' greatest deviation, s."""
    delay = stamps_ns - even
    offset = int(np.median(delay))
    deviation = np.abs(delay - offset)
    worst = int(np.argmax(deviation))
    if deviation[worst] > round(clock.steady_within_s * 1e9):
        raise DataError(
            f"row {worst} is stamped {(delay[worst] - offset) * 1e-9:+.4f} s off an even rate of {clock.rate_hz:g} Hz",
            place=place,
            expected=f"within clock.steady_within_s = {clock.steady_within_s:g} s: rows are missing, or clock.rate_hz "
            "is wrong",
        )
    return even + offset, float(deviation[worst]) * 1e-9


def _rising(times: NDArray[np.int64], clock: Clock, place: str) -> tuple[NDArray[np.int64], Fault, Fault]:
    """Rows later than every row before them; the others are counted, or an error, as `unordered` says."""
    before = np.maximum.accumulate(times)[:-1]
    rises = np.concatenate([[True], times[1:] > before])
    late = np.flatnonzero(~rises)
    same = late[times[late] == before[late - 1]]
    back = late[times[late] < before[late - 1]]
    if late.size and clock.unordered == "error":
        row = int(late[0])
        what = (
            "repeats the time before it" if row in same else f"goes back from {before[row - 1] * 1e-9:.6f} s"
        )
        raise DataError(
            f"{times[row] * 1e-9:.6f} s, {what} ({same.size} rows repeat a time, {back.size} go back)",
            place=f"{place}: row {row}",
            expected="rising times",
            hint='clock.unordered = "drop" leaves such rows out',
        )
    return np.flatnonzero(rises), _fault(same, times), _fault(back, times)


def _fault(rows: NDArray[np.int64], times: NDArray[np.int64]) -> Fault:
    """Of rows of the file, and the times of all its rows."""
    if not rows.size:
        return Fault()
    return Fault(int(rows.size), int(rows[0]), float(times[rows[0]]) * 1e-9)


def _long_steps(
    steps_s: NDArray[np.float64],
    rows: NDArray[np.int64],
    times: NDArray[np.int64],
    longer_s: float,
    until_s: float,
) -> Fault:
    """Steps longer than `longer_s` and up to `until_s`, located by the row after the step."""
    long = (steps_s > longer_s) & (steps_s <= until_s)
    return replace(
        _fault(rows[1:][long], times), longest_s=float(steps_s[long].max()) if long.any() else None
    )
