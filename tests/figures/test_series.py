"""Thinning loses no extreme, and a map's frame holds its tracks."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bottomlock.figures.series import Floats, Track, frame_of, scattered_rows, thinned_rows

VALUES = arrays(
    np.float64, st.integers(60, 400), elements=st.one_of(st.floats(-1e6, 1e6), st.just(float("nan")))
)


@given(VALUES, st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_every_part_keeps_its_extremes(value: Floats, buckets: int, seed: int) -> None:
    """Of each of two curves, in each equal part of the time; and a break of the line stays one."""
    rng = np.random.default_rng(seed)
    time_ns = np.cumsum(rng.integers(1, 10**9, len(value)))
    other = rng.standard_normal(len(value))
    rows = thinned_rows(time_ns, [value, other], buckets)
    assert rows[0] == 0
    assert rows[-1] == len(value) - 1
    assert (np.diff(rows) > 0).all()
    part = (time_ns - time_ns[0]) * buckets // (time_ns[-1] - time_ns[0] + 1)
    for one in (value, other):
        for number in np.unique(part):
            whole, kept = one[part == number], one[rows[part[rows] == number]]
            if np.isfinite(whole).any():
                assert np.nanmin(kept) == np.nanmin(whole)
                assert np.nanmax(kept) == np.nanmax(whole)
    for gap in np.flatnonzero(np.isnan(value[1:]) & ~np.isnan(value[:-1])) + 1:
        assert gap in rows


def test_few_are_all_kept_and_many_are_few() -> None:
    time_ns = np.arange(72_000) * 50_000_000
    value = np.sin(np.arange(72_000) * 0.01)
    assert len(thinned_rows(time_ns[:100], [value[:100]], 50)) == 100
    assert len(thinned_rows(time_ns, [value], 500)) <= 2 * 500 + 2


def test_a_cloud_keeps_its_spread_and_its_extremes() -> None:
    value = np.random.default_rng(3).standard_normal(50_000)
    value[31_234] = 9.0
    rows = scattered_rows(np.arange(50_000) * 10**8, value, 300)
    assert len(rows) < 900
    assert value[rows].max() == 9.0
    # Extremes alone would scatter by 2.5; 150 of 750 points are extremes of 330.
    assert np.median(np.abs(value[rows])) < 1.0


def test_a_frame_holds_its_tracks_with_a_margin() -> None:
    """A straight track to the north still has a frame of some width."""
    north = np.array([0.0, 300.0, np.nan])
    frame = frame_of([Track("a", "#000000", np.arange(3), north, np.zeros(3))])
    assert frame.south_m < 0.0
    assert frame.north_m > 300.0
    assert frame.west_m < -20.0
    assert frame.east_m > 20.0
