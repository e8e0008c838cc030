"""A glider's dive with the bottom hidden: what the water's beams with the current by depth are worth, and their sigma.

The recording, its windows and errors are those of `tests/statistical/glider.py`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bottomlock.kernel import models
from tests.statistical.glider import (
    BY_DEPTH,
    RECORDING,
    Dive,
    errors_of_window,
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


@pytest.mark.long
@pytest.mark.parametrize(
    ("seconds", "median_m", "most_m"), [(60.0, 1.4, 2.6), (300.0, 4.3, 8.0), (600.0, 7.4, 12.0)]
)
def test_minutes_without_the_bottom(dive: Dive, seconds: float, median_m: float, most_m: float) -> None:
    """Seen: 0.8 m (90 %: 2.1 m), 2.4 (6.0) and 4.8 (9.3) after 60, 300 and 600 s.

    Of all pings, with a fifth of them without water: 1.3 m (3.2 m), 6.9 (13.0), 11.2 (22.8); sigma is of these.

    Without water the filter has 3.6, 12.4 and 20.1 m. The bounds hold for each half of the dive.
    """
    found = errors(dive, seconds)
    error_m, _, over_sd = found.T
    for part in (error_m, *np.array_split(error_m, 2)):
        assert np.median(part) < median_m
        assert np.quantile(part, 0.9) < most_m
    assert 0.5 < np.sqrt(np.mean(over_sd**2)) < 1.4
    without = errors(dive, seconds, water=False)
    assert np.median(error_m) < 0.3 * np.median(without[:, 0])


@pytest.mark.long
def test_the_current_by_depth_halves_the_error(dive: Dive) -> None:
    """Seen after 600 s: 4.8 m by depth, 15.3 m with one current of 0.3 m/s and half an hour."""
    by_depth, one = (errors(dive, 600.0, layers=layers)[:, 0] for layers in (BY_DEPTH, ONE_CURRENT))
    assert np.median(by_depth) < 0.6 * np.median(one)
