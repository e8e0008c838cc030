"""Times of a stream: gaps, jumps, repeats and steps back are counted with the first place; nothing is repaired."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.errors import DataError
from bottomlock.recordings.stream_sections import Clock
from bottomlock.replay.clock import row_times

S = 1_000_000_000


def stamps(*seconds: float) -> np.ndarray:
    return np.array([round(s * S) for s in seconds], dtype=np.int64)


def test_by_hand() -> None:
    """One gap of 5 s, one jump of 100 s, one repeat, one step back; steps are 1 s otherwise."""
    times = stamps(0, 1, 2, 2, 3, 8, 9, 7, 10, 110, 111, 112, 113)
    timed = row_times(times, len(times), Clock(column="t", unordered="drop", gap_s=2.0), place="log")
    report = timed.report
    assert (report.rows, report.kept) == (13, 11)
    assert (report.repeats.count, report.repeats.row, report.repeats.time_s) == (1, 3, 2.0)
    assert (report.backward.count, report.backward.row, report.backward.time_s) == (1, 7, 7.0)
    assert (report.gaps.count, report.gaps.row, report.gaps.longest_s) == (1, 5, 5.0)
    assert (report.jumps.count, report.jumps.row, report.jumps.longest_s) == (1, 9, 100.0)
    assert timed.rows.tolist() == [0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 12]
    assert report.gaps.text == "1, first at row 5, 8.000 s, longest 5 s"


@pytest.mark.parametrize(("step_s", "count"), [(2.9, 0), (3.1, 1)])
def test_a_gap_is_more_than_three_median_steps(step_s: float, count: int) -> None:
    times = stamps(0, 1, 2, 3, 4, 4 + step_s, 5 + step_s)
    assert row_times(times, len(times), Clock(column="t"), place="log").report.gaps.count == count


@pytest.mark.parametrize(
    ("times", "message"),
    [
        (stamps(0, 1, 1), "log: row 2: 1.000000 s, repeats"),
        (stamps(0, 5, 3), "log: row 2: 3.000000 s, goes back from 5"),
    ],
)
def test_disorder_is_refused_unless_declared(times: np.ndarray, message: str) -> None:
    with pytest.raises(DataError, match=message):
        row_times(times, len(times), Clock(column="t"), place="log")


def test_rows_at_an_even_rate() -> None:
    timed = row_times(None, 4, Clock(rate_hz=100.0, start_s=0.5, offset_s=-0.2), place="log")
    assert timed.time_ns.tolist() == [300_000_000, 310_000_000, 320_000_000, 330_000_000]


def test_even_rate_through_jittering_stamps() -> None:
    """The stamps' median delay places the rows; how far they stray is told, and too far is rejected."""
    even = np.arange(101) * 20_000_000
    jitter = np.where(np.arange(101) % 2 == 0, 0, 4_000_000)
    timed = row_times(even + jitter + 7 * S, 101, Clock(column="t", rate_hz=50.0), place="log")
    assert np.array_equal(timed.time_ns, even + 7 * S)
    assert timed.report.max_stamp_deviation_s == pytest.approx(0.004)
    late = np.where(np.arange(101) > 60, 100_000_000, 0)  # five rows are missing
    with pytest.raises(DataError, match=r"rows are missing, or clock.rate_hz is wrong"):
        row_times(even + late, 101, Clock(column="t", rate_hz=50.0), place="log")


@given(st.lists(st.integers(0, 50), min_size=1, max_size=40))
def test_kept_times_rise_and_every_row_is_accounted_for(ticks: list[int]) -> None:
    """Whatever the stamps: kept times rise strictly, and kept, repeated and backward rows add up."""
    times = np.array(ticks, dtype=np.int64) * S
    timed = row_times(times, len(times), Clock(column="t", unordered="drop"), place="log")
    assert (np.diff(timed.time_ns) > 0).all()
    report = timed.report
    assert report.kept + report.repeats.count + report.backward.count == len(ticks)
