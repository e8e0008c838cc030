"""Bands for average NEES and what a check with bands may cost in false alarms (Bar-Shalom et al. 2001, Sect. 5.4)."""

import numpy as np
from scipy import stats

from tests.oracle.rotations import Array


def average_band(degrees: int, runs: int, probability: float = 0.95) -> tuple[float, float]:
    """Band for the mean over independent runs of a chi-squared variable: runs times the mean has degrees·runs."""
    tail = (1 - probability) / 2
    total = stats.chi2(degrees * runs)
    return float(total.ppf(tail) / runs), float(total.ppf(1 - tail) / runs)


def independent_samples(series: Array) -> float:
    """Number of independent samples to which a correlated series (runs, T) amounts, per run.

    T / (1 + 2 Σ ρ_k) with the autocorrelation ρ_k averaged over runs, summed to its first zero crossing.
    """
    deviation = series - series.mean()
    steps = series.shape[1]
    variance = float(np.mean(deviation**2))
    correlation_sum = 0.0
    for lag in range(1, steps):
        rho = float(np.mean(deviation[:, lag:] * deviation[:, :-lag])) / variance
        if rho <= 0:
            break
        correlation_sum += (1 - lag / steps) * rho
    return float(steps / (1 + 2 * correlation_sum))


def least_fraction_inside(
    series: Array, expected: float, band: tuple[float, float], alarm: float = 0.01
) -> float:
    """Fraction of times at which the mean over runs lies inside `band` in all but `alarm` of consistent ensembles.

    NEES is correlated over the whole run (2 to 5 independent samples in 250 s), so the fraction inside a 95 % band
    scatters widely about 0.95. Its distribution is had by a multiplier bootstrap: the deviations of the runs from their
    mean, each with a random Gaussian factor, added to `expected`, keep the correlation in time that the runs show.
    `series` is (runs, T). The drawing is seeded, so the limit is a number and not a chance.
    """
    runs = len(series)
    deviation = series - series.mean(axis=0)
    factors = np.random.default_rng(1).normal(size=(4000, runs)) / runs
    means = expected + factors @ deviation
    inside = np.mean((means > band[0]) & (means < band[1]), axis=1)
    return float(np.quantile(inside, alarm))


def mean_band(per_run_means: Array, expected: float, probability: float = 0.95) -> tuple[float, float]:
    """Band about `expected` for the mean over runs, from the spread between runs (Student's t).

    Each run gives one time-averaged number, however its own samples are correlated; the runs are independent.
    """
    n = len(per_run_means)
    half = stats.t(n - 1).ppf((1 + probability) / 2) * np.std(per_run_means, ddof=1) / np.sqrt(n)
    return expected - float(half), expected + float(half)
