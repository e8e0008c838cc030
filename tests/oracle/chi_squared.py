"""Bands for average NEES and what a check with bands may cost in false alarms (Bar-Shalom et al. 2001, Sect. 5.4)."""

from __future__ import annotations

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


def least_fraction_inside(effective_samples: float, coverage: float = 0.95, alarm: float = 1e-3) -> float:
    """Fraction of times that lies inside a `coverage` band in all but `alarm` of the checks.

    The number inside of n independent times is binomial; n is the effective number, rounded down and at least one.
    """
    n = max(1, int(effective_samples))
    return float(stats.binom(n, coverage).ppf(alarm)) / n


def mean_band(per_run_means: Array, expected: float, probability: float = 0.95) -> tuple[float, float]:
    """Band about `expected` for the mean over runs, from the spread between runs (Student's t).

    Each run gives one time-averaged number, however its own samples are correlated; the runs are independent.
    """
    n = len(per_run_means)
    half = stats.t(n - 1).ppf((1 + probability) / 2) * np.std(per_run_means, ddof=1) / np.sqrt(n)
    return expected - float(half), expected + float(half)
