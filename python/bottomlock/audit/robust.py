"""Robust fits, and standard deviations that allow for correlated pings."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import t

from bottomlock.audit.findings import SIGNIFICANCE
from bottomlock.audit.logs import Array, Flags
from bottomlock.recordings.robust import PER_BLOCK, correlation_blocks, sd_about_median

HUBER = 1.345
"""Threshold of Huber's loss in sigmas: 95 % efficiency for Gaussian noise."""

RESAMPLES = 300
"""Resamples of a bootstrap."""
LEAST_BLOCKS = 8
"""Fewer blocks give no standard deviation: with 8 its own relative deviation is 1 / sqrt(2 x 7), a quarter."""


def resolution(values: Array) -> float:
    """Resolution of recorded values: the least non-zero difference; 0 where all are equal.

    >>> resolution(np.array([0.003, 0.001, 0.001, 0.008]))
    0.002
    """
    steps = np.diff(np.unique(np.round(values[np.isfinite(values)], 9)))
    return float(np.round(steps.min(), 9)) if steps.size else 0.0


def sigmas_for(blocks: int) -> float:
    """Standard deviations beyond which a value is significant whose deviation is of this many blocks; else infinite.

    Quantile of Student's t, as a deviation from few blocks is itself uncertain, and larger by what correlation takes
    from the variance of blocks of `PER_BLOCK` times.

    >>> round(sigmas_for(50), 2), sigmas_for(5)
    (5.69, inf)
    """
    if blocks < LEAST_BLOCKS:
        return np.inf
    return float(t.isf(SIGNIFICANCE / 2.0, blocks - 1) / np.sqrt(1.0 - 0.5 / PER_BLOCK))


def significant(off: Array | float, sd: Array | float, blocks: int, least: float) -> Flags:
    """Whether departures are beyond chance, by their 1 sigma of this many blocks, and larger than matters: `least`.

    >>> significant(np.array([0.1, 0.1, 3.0]), np.array([0.01, 0.1, 0.1]), 50, 0.05).tolist()
    [True, False, True]
    """
    return np.asarray(np.abs(off) > np.maximum(least, sigmas_for(blocks) * np.asarray(sd)))


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Robust fit of `y = X p` with bootstrapped copies.

    Attributes:
        parameters: (p,) or (p, k).
        resampled: (RESAMPLES, p) or (RESAMPLES, p, k) fits of resampled blocks.
        residuals: (n,) or (n, k).
        blocks: number of blocks that were resampled.
    """

    parameters: Array
    resampled: Array
    residuals: Array
    blocks: int


def fit_linear(X: Array, Y: Array, Z: Array | None = None) -> LinearFit:
    """Huber fit of Y (n, k) on X (n, p), by reweighting; with instruments Z (n, p), two-stage least squares.

    A row's weight is that of its worst channel, each on its own robust scale. Instruments are needed where the noise of
    X is correlated with that of Y: Z must share the signal of X and none of its noise.

    Source: Huber 1981, section 7.8; block bootstrap of consecutive rows (Künsch 1989), since noise that is correlated
    over several pings would otherwise make the standard deviations too small.
    """
    Z, Yk = X if Z is None else Z, Y.reshape(len(Y), -1)
    weights = np.ones(len(X))
    for _ in range(30):
        weighted = Z * weights[:, None]
        parameters = _solve(weighted.T @ X, weighted.T @ Yk)
        left = Yk - X @ parameters
        worst = (np.abs(left) / (HUBER * np.maximum(sd_about_median(left, axis=0), 1e-12))).max(axis=1)
        before, weights = weights, 1.0 / np.maximum(worst, 1.0)
        if np.max(np.abs(weights - before)) < 1e-6:
            break
    weighted = Z * weights[:, None]
    member = correlation_blocks(weighted[:, :, None] * left[:, None, :])
    count = int(member[-1]) + 1
    starts = np.searchsorted(member, np.arange(count))
    normal = np.add.reduceat(weighted[:, :, None] * X[:, None, :], starts)
    right = np.add.reduceat(weighted[:, :, None] * Yk[:, None, :], starts)
    # A fixed seed: the same log gives the same audit.
    draws = np.random.default_rng(20_240_229).multinomial(count, np.full(count, 1.0 / count), size=RESAMPLES)
    copies = _solve(np.einsum("rb,bij->rij", draws, normal), np.einsum("rb,bij->rij", draws, right))
    if Y.ndim == 1:
        return LinearFit(parameters[:, 0], copies[:, :, 0], left[:, 0], count)
    return LinearFit(parameters, copies, left, count)


def _solve(A: Array, b: Array) -> Array:
    """A⁻¹ b, of least norm where A is singular (readings without closure, for instance); A may be a stack."""
    return np.asarray(np.linalg.pinv(A, rcond=1e-12) @ b)
