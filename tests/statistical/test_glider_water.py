"""A glider's dive with the bottom hidden: what the water's beams with the current by depth are worth, and their sigma.

The recording and its windows are those of `tests/statistical/glider.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock.kernel import models
from partialdvl_bench.methods import replayed
from tests.statistical.glider import (
    BY_DEPTH,
    RECORDING,
    Dive,
    error_of_window,
    mission_of_window,
    read_dive,
    windows,
)

Floats = NDArray[np.float64]

ONE_CURRENT = models.CurrentLayers(sd_mps=0.0)


@pytest.fixture(scope="module")
def dive(recordings: Path) -> Dive:
    path = recordings / RECORDING
    if not path.exists():
        pytest.skip("the glider's recording is not there")
    return read_dive(path)


def errors(
    dive: Dive, seconds: float, *, water: bool = True, layers: models.CurrentLayers = BY_DEPTH
) -> Floats:
    """(w, 2) errors of `tc`, m, and over their sigma, of every window in half of which the bottom is known."""
    found = []
    for first, last in windows(dive, seconds):
        mission = mission_of_window(dive, first, last, water=water, layers=layers)
        found.append(error_of_window(dive, first, last, replayed(mission, "tc")))
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize(("seconds", "median_m", "most_m"), [(300.0, 6.4, 16.0), (600.0, 12.0, 28.0)])
def test_ten_minutes_without_the_bottom(dive: Dive, seconds: float, median_m: float, most_m: float) -> None:
    """Seen: 4.8 m (90 %: 13.1 m) after 300 s, 10.0 m (23.9 m) after 600 s; without water 49 m and 106 m."""
    found = errors(dive, seconds)
    error_m, over_sd = found.T
    assert np.median(error_m) < median_m
    assert np.quantile(error_m, 0.9) < most_m
    assert 0.5 < np.sqrt(np.mean(over_sd**2)) < 1.4
    without = errors(dive, seconds, water=False)
    assert np.median(error_m) < 0.2 * np.median(without[:, 0])


@pytest.mark.long
def test_the_current_by_depth_halves_the_error(dive: Dive) -> None:
    """Seen after 600 s: 10.0 m by depth, 21.8 m with one current of 0.3 m/s and half an hour."""
    by_depth, one = (errors(dive, 600.0, layers=layers)[:, 0] for layers in (BY_DEPTH, ONE_CURRENT))
    assert np.median(by_depth) < 0.6 * np.median(one)
