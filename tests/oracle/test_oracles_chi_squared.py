"""The chi-squared bands on cases with a known answer."""

import numpy as np
import pytest
from scipy import stats

from tests.dive import gauss_markov
from tests.oracle import chi_squared


def test_average_band_of_textbooks() -> None:
    """Bar-Shalom's example: 50 runs of a four-state NEES stay within 3.26 and 4.82 at 95 %."""
    lo, hi = chi_squared.average_band(4, 50)
    assert lo == pytest.approx(3.255, abs=0.01)
    assert hi == pytest.approx(4.820, abs=0.01)


def test_bands_let_true_chi_squared_pass_at_their_rate() -> None:
    """The checks' own false alarms, on correlated Gaussian errors with the right covariance, 200 ensembles, seed 5."""
    rng = np.random.default_rng(5)
    runs, steps, dof, ensembles, memory = 50, 60, 3, 200, 0.8
    lo, hi = chi_squared.average_band(dof, runs)
    fraction_alarms = mean_alarms = 0
    for _ in range(ensembles):
        errors = gauss_markov(rng.normal(size=(steps, runs, dof)), 1.0, -1.0 / np.log(memory))
        nees = np.sum(errors**2, axis=2).T
        mean = nees.mean(axis=0)
        inside = np.mean((mean > lo) & (mean < hi))
        fraction_alarms += inside < chi_squared.least_fraction_inside(nees, dof, (lo, hi))
        band = chi_squared.mean_band(nees.mean(axis=1), dof)
        mean_alarms += not band[0] < nees.mean() < band[1]
    # 1 % asked: 2 expected; the bootstrap of 50 runs is itself rough, so up to three times that is let pass.
    assert fraction_alarms <= stats.binom(ensembles, 0.03).ppf(0.99)
    # 5 % asked: 10 expected, binomial 99.8 % interval.
    assert stats.binom(ensembles, 0.05).ppf(1e-3) <= mean_alarms <= stats.binom(ensembles, 0.05).ppf(0.999)


def test_independent_samples_of_a_known_process() -> None:
    """Memory a of a first-order process leaves (1 − a)/(1 + a) independent samples of each; its square has a²."""
    rng = np.random.default_rng(8)
    x = gauss_markov(rng.normal(size=(200, 400)), 1.0, -1.0 / np.log(0.8)).T
    expected = 200 * (1 - 0.64) / (1 + 0.64)
    assert chi_squared.independent_samples(x**2) == pytest.approx(expected, rel=0.1)


def test_bands_catch_an_overconfident_filter() -> None:
    """A covariance 20 % too small in every variance raises NEES by 25 %: both checks must fail it."""
    rng = np.random.default_rng(7)
    nees = np.sum(rng.normal(size=(200, 50, 6)) ** 2, axis=2) / 0.8
    lo, hi = chi_squared.average_band(6, 200)
    mean = nees.mean(axis=0)
    inside = np.mean((mean > lo) & (mean < hi))
    assert inside < chi_squared.least_fraction_inside(nees, 6, (lo, hi))
    assert nees.mean() > chi_squared.mean_band(nees.mean(axis=1), 6)[1]
