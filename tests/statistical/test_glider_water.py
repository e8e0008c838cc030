"""A glider's dive with the bottom hidden: what the water's beams with the current by depth are worth, and their sigma.

The recording, its windows and errors are those of `tests/statistical/glider.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.kernel import models
from tests.statistical.glider import (
    BY_DEPTH,
    MOUNTING_PITCH,
    PING_S,
    RECORDING,
    TO_VELOCITY,
    Dive,
    errors_of_window,
    known,
    mission_of_window,
    read_dive,
    windows,
)
from tests.statistical.missions import replayed

Floats = NDArray[np.float64]

ONE_CURRENT = models.CurrentLayers(sd_mps=0.0)


@pytest.fixture(scope="module")
def dive(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Dive:
    if not (recordings / RECORDING).exists():
        pytest.skip("the glider's recording is not there")
    return read_dive(recordings, tmp_path_factory.mktemp("glider"))


def errors(
    dive: Dive, seconds: float, *, water: bool = True, layers: models.CurrentLayers = BY_DEPTH
) -> Floats:
    """(w, 3) `Errors` of `tc` in every window."""
    found = []
    for first, last in windows(dive, seconds):
        mission = mission_of_window(dive, first, last, water=water, layers=layers)
        found.append(errors_of_window(dive, first, last, replayed(mission, "tc")))
    return np.array(found)


def table_errors(dive: Dive, seconds: float) -> Floats:
    """(w,) errors with water, m, with the mean current within 2 m of depth in the half hour before."""
    water = dive.water_ned_mps[:, :2]
    current = dive.ned_mps[:, :2] - water
    both, found = known(current), []
    for first, last in windows(dive, seconds):
        begin = np.searchsorted(dive.time_ns, dive.time_ns[first] - 1_800_000_000_000)
        lock = begin + np.flatnonzero(both[begin:first])
        total = np.zeros(2)
        for ping in first + np.flatnonzero(both[first:last]):
            apart = np.abs(dive.depth_m[lock] - dive.depth_m[ping])
            near = lock[apart <= max(2.0, apart.min() + 0.01)]
            total += current[near].mean(axis=0) - current[ping]
        found.append(np.hypot(*total) * PING_S)
    return np.array(found)


def test_the_depth_changes_as_the_mounting_says(dive: Dive) -> None:
    """Seen: 0.051 m/s RMS of a depth rate of 0.102 and no mean; 0.164 and 0.146 m/s without the mounting."""

    def misfit(pitch: float) -> Floats:
        turned = (dive.attitude * Rotation.from_euler("Y", pitch)).apply(np.nan_to_num(dive.velocity_p_mps))[
            :, 2
        ]
        down = np.where(known(dive.velocity_p_mps), turned, np.nan)
        time_s = (dive.time_ns - dive.time_ns[0]) * 1e-9
        rate = (dive.depth_m[4:] - dive.depth_m[:-4]) / (time_s[4:] - time_s[:-4])
        found: Floats = rate - down[2:-2]
        return found[np.isfinite(found) & (dive.depth_m[2:-2] > 1.0)]

    with_it, without = misfit(0.0), misfit(-MOUNTING_PITCH)
    assert abs(with_it.mean()) < 0.005
    assert np.sqrt(np.mean(with_it**2)) < 0.06
    assert without.mean() > 0.1


def test_side_lobes_slow_the_water_near_the_bottom(dive: Dive) -> None:
    """A lobe straight down sees no motion. Of the speed it shows 0.52 to 2 m of range, 0.69 at 3 m, 1.01 from 7 m."""
    first = dive.table.cell == 1
    good = dive.table.valid[first].all(axis=1) & known(dive.velocity_p_mps)
    ahead = (dive.table.velocity_mps[first] @ TO_VELOCITY.T)[:, 0], dive.velocity_p_mps[:, 0]

    def part(least_m: float, most_m: float) -> float:
        rows = good & (dive.range_m >= least_m) & (dive.range_m < most_m) & (dive.depth_m > 1.0)
        water, bottom = (one[rows] for one in ahead)
        return float(water @ bottom / (bottom @ bottom))

    assert part(0.0, 2.0) < 0.6
    assert part(3.0, 4.0) < 0.8
    assert 0.97 < part(7.0, 14.0) < 1.03


@pytest.mark.long
@pytest.mark.parametrize(
    ("seconds", "median_m", "most_m"), [(60.0, 1.4, 2.6), (300.0, 4.3, 8.0), (600.0, 7.4, 12.0)]
)
def test_minutes_without_the_bottom(dive: Dive, seconds: float, median_m: float, most_m: float) -> None:
    """Seen: 0.8 m (90 %: 2.1 m), 2.4 (6.0) and 4.8 (9.3) after 60, 300 and 600 s.

    Of all pings, with a fifth of them without water: 1.3 m (3.2 m), 6.9 (13.0), 11.2 (22.8); sigma is of these.

    A plain table of the current by depth has 0.7 (2.3), 2.4 (5.4) and 5.4 (10.0); the filter without water 3.6, 12.4
    and 20.1 m. The bounds hold for each half of the dive.
    """
    found = errors(dive, seconds)
    error_m, _, over_sd = found.T
    for part in (error_m, *np.array_split(error_m, 2)):
        assert np.median(part) < median_m
        assert np.quantile(part, 0.9) < most_m
    assert 0.5 < np.sqrt(np.mean(over_sd**2)) < 1.4
    table = table_errors(dive, seconds)
    assert np.median(error_m) < 1.2 * np.median(table)
    assert np.quantile(error_m, 0.9) < 1.2 * np.quantile(table, 0.9)
    without = errors(dive, seconds, water=False)
    assert np.median(error_m) < 0.3 * np.median(without[:, 0])


@pytest.mark.long
def test_the_current_by_depth_halves_the_error(dive: Dive) -> None:
    """Seen after 600 s: 4.8 m by depth, 15.3 m with one current of 0.3 m/s and half an hour."""
    by_depth, one = (errors(dive, 600.0, layers=layers)[:, 0] for layers in (BY_DEPTH, ONE_CURRENT))
    assert np.median(by_depth) < 0.6 * np.median(one)
