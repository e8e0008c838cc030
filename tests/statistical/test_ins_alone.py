"""The INS without aiding: its error after 250 s is the initial tilt's, as PAPER works out by hand."""

import numpy as np
import pytest
from scipy import stats

from tests.oracle import chi_squared
from tests.statistical import ensembles

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


def test_velocity_error_after_250_s() -> None:
    """√2 · g · 0.01 rad · 250 s = 34.5 m/s for the tilt alone lies in the 95 % interval of our RMS over 200 runs.

    The mean square of a two-component Gaussian error over n runs is chi-squared of 2n degrees. The filter's own
    covariance, which holds the biases and noise as well, must lie in the same interval.
    """
    ensemble = ensembles.run_ensemble("straight", ("ins",), every_s=50)
    error = ensemble.errors("ins")[:, -1, 6:9]
    mean_square = float(np.mean(np.sum(error**2, axis=1)))
    degrees = 2 * ensembles.RUNS
    low, high = (np.sqrt(mean_square * degrees / stats.chi2(degrees).ppf(q)) for q in (0.975, 0.025))
    by_hand = np.sqrt(2) * 9.8 * 0.01 * 250
    assert low < by_hand < high
    claimed = float(np.sqrt(np.mean(np.sum(ensemble.batch["sd"][:, 0, -1, 6:9] ** 2, axis=1))))
    assert low < claimed < high


def test_standalone_ins_is_consistent() -> None:
    """Without updates the covariance is pure propagation: NEES inside its band though errors grow to 35 m/s."""
    nees = ensembles.run_ensemble("straight", ("ins",), every_s=50).nees("ins")
    low, high = chi_squared.mean_band(nees.mean(axis=1), 6)
    assert low < nees.mean() < high
