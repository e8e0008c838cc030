"""Robust standard deviations: hand-worked cases, and that of Gaussian values."""

import numpy as np
import pytest

from bottomlock.recordings.robust import sd_about_median, sd_about_zero


def test_median_magnitude_by_hand() -> None:
    values = np.array([[-3.0, 10.0], [1.0, 10.0], [2.0, -14.0]])
    assert sd_about_zero(values, axis=0) == pytest.approx([2.0 * 1.4826, 10.0 * 1.4826])
    assert sd_about_median(values, axis=0) == pytest.approx([1.0 * 1.4826, 0.0])


def test_of_gaussian_values_it_is_their_standard_deviation() -> None:
    values = 0.02 * np.random.default_rng(5).standard_normal((40_000, 2)) + [0.0, 1.0]
    # The median of n magnitudes is 1.17 / sqrt(n) of sigma uncertain: 0.6 %, and five of those.
    assert sd_about_median(values, axis=0) == pytest.approx(0.02, rel=0.03)
    assert sd_about_zero(values[:, 0]) == pytest.approx(0.02, rel=0.03)


def test_of_no_values_there_is_none() -> None:
    assert np.isnan(sd_about_zero(np.empty((0, 3)), axis=0)).tolist() == [True] * 3
    assert np.isnan(sd_about_median([]))
