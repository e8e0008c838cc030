"""Errors over their 1 sigma: of a median, a bias, a slope's probability."""

import numpy as np
import pytest

from bottomlock.audit.closure import closure_of, closure_slope, null_space
from bottomlock.audit.matrix import find_matrix
from bottomlock.audit.robust import resolution
from tests.audit.synthetic import Array, janus, make_log, motion

WEIGHTS = np.array([1.0, -1.0, 1.0, -1.0])


def rms(values: list[float] | Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("lasting", [1, 5])
def test_median_of_a_closure(lasting: int) -> None:
    """200 logs of noise, white or that lasts five pings: the RMS of error over sigma has a deviation of 5 %."""
    rng = np.random.default_rng(7)
    off = []
    for _ in range(200):
        y = np.repeat(rng.normal(size=(600 // lasting, 4)), lasting, axis=0)
        one = closure_of(WEIGHTS, y)
        off.append(one.median_mps / one.median_sd_mps)
        assert one.sigma_mps == pytest.approx(2.0, rel=0.35)
        assert one.p99_mps == pytest.approx(2.0 * 2.58, rel=0.4)
        assert not one.heavy
    assert 0.8 < rms(off) < 1.2


def test_bias_of_a_beam() -> None:
    """24 logs beside a velocity without noise, and no bias: error over sigma, four beams each."""
    off = []
    for seed in range(24):
        log = make_log(200 + seed, pings=400, decimals=None)
        own = motion(np.random.default_rng(200 + seed), 400)
        found = find_matrix(log.velocity_mps, own)
        assert found is not None
        off += list(found.bias_mps / found.bias_sd_mps)
    assert 0.7 < rms(off) < 1.4


def test_probability_of_a_slope() -> None:
    """Of 40 right matrices none is accused, and half have more than 0.2.

    It is not even: with slow motion a few blocks count for most, and a quarter of right matrices has less than 0.1.
    """
    values, rows = [], janus()
    for seed in range(40):
        rng = np.random.default_rng(300 + seed)
        y = motion(rng, 800) @ rows.T + 0.02 * rng.normal(size=(800, 4))
        slope = closure_slope(y @ null_space(rows)[:, 0], y @ np.linalg.pinv(rows).T, np.arange(800))
        assert slope is not None
        assert not slope.material
        values.append(slope.p_value)
    assert 0.2 < np.median(values) < 0.6
    assert min(values) > 1e-4


def test_resolution_of_readings_that_binary_numbers_only_come_near() -> None:
    assert resolution(np.array([0.1, 0.1 + 1e-12, 0.2, 0.3, np.nan])) == 0.1
    assert resolution(np.array([1.5, 1.5])) == 0.0
