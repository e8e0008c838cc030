"""Closure: the combinations of the beams to which no velocity contributes, and what they show of the instrument.

With A (beams, 3) and N its left null space, `Nᵀ y = Nᵀ (bias + noise)`; the closure of a Janus is 1 − 2 + 3 − 4 in the
order of azimuth. A closure that depends on the velocity shows that the true beam matrix is not A:
`E[n · y | v] = nᵀ (A_true − A) v`.

Limits of observability: A and A·T have the same null space for every invertible T (3, 3). Closure thus leaves 9 of the
12 entries of four beams free; with unit beams it leaves 5 (three rotations of the whole and two stretches that trade
tilt against azimuth). Of the 24 orders of four Janus beams it distinguishes 3 classes of 8; of four biases it observes
one combination.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f, norm

from bottomlock.audit.robust import (
    LEAST_BLOCKS,
    Array,
    fit_linear,
    resolution,
    sigma,
)
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.robust import blocks_of, correlation_rows

GAUSSIAN_BEYOND_3 = float(2.0 * norm.sf(3.0))


def null_space(rows: Array) -> Array:
    """(beams, beams − rank) basis of the left null space, each column scaled so that its (first) largest entry is 1.

    >>> null_space(np.array([[1.0, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]])).round(9).T.tolist()
    [[1.0, -1.0, 1.0, -1.0]]
    """
    left = closure_rows(rows).T
    if not left.size:
        return np.zeros((len(rows), 0))
    largest = np.argmax(np.abs(left) > np.abs(left).max(axis=0) * (1.0 - 1e-2), axis=0)
    return np.asarray(left / left[largest, np.arange(left.shape[1])])


@dataclass(frozen=True, eq=False)
class Closure:
    """Statistics of the closure over full pings, m/s.

    `beyond_3_sigma` is the fraction beyond three robust sigmas and two steps of resolution: 0.0027 for Gaussian noise.
    `white_sigma_mps` is the spread of the part that changes from ping to ping, from first differences. `blocks` are the
    independent blocks behind `median_sd_mps`; `independent` is the number of pings that its size is worth,
    of correlated ones fewer than there are.
    """

    weights: Array
    values_mps: Array
    pings: int
    median_mps: float
    median_sd_mps: float
    median_abs_mps: float
    sigma_mps: float
    white_sigma_mps: float
    p95_mps: float
    p99_mps: float
    max_mps: float
    beyond_3_sigma: float
    blocks: int
    independent: float

    @property
    def beam_sigma_mps(self) -> float:
        """Noise of one beam, m/s, 1 sigma, if all beams are equally noisy."""
        return self.sigma_mps / float(np.linalg.norm(self.weights))

    def with_rows_uncertain(self, velocity_mps: Array, cov: Array) -> "Closure":
        """The same where the rows are uncertain: covariance (3, 3) of the closure's slope on the velocity (3,)."""
        added = float(velocity_mps @ cov @ velocity_mps)
        return replace(self, median_sd_mps=float(np.hypot(self.median_sd_mps, np.sqrt(added))))


def closure_of(weights: Array, readings_mps: Array) -> Closure:
    """Statistics of the combination `weights` (beams,) over readings (n, beams) of full pings."""
    values = readings_mps @ weights
    size = np.abs(values)
    spread, middle = sigma(values), float(np.median(values))
    # The median of rounded values may be one step off, and three sigmas with it.
    coarse = 2.0 * max(resolution(column) for column in readings_mps.T)
    lasting = correlation_rows(np.sign(values - middle))
    member = blocks_of(len(values), max(lasting, 2.0))
    count = int(member[-1]) + 1
    blocks = np.split(values, np.searchsorted(member, np.arange(1, count)))
    # Medians of consecutive blocks: noise that is correlated over several pings widens their spread as it should.
    claimed = count >= LEAST_BLOCKS
    spread_of_blocks = float(np.std([np.median(block) for block in blocks], ddof=1)) if claimed else np.inf
    middle_sd = 1.2533 * spread_of_blocks / np.sqrt(count)
    beyond = np.abs(values - middle) > 3.0 * max(spread, 1e-12) + coarse
    return Closure(
        weights=weights,
        values_mps=values,
        pings=len(values),
        median_mps=middle,
        median_sd_mps=middle_sd,
        median_abs_mps=float(np.median(size)),
        sigma_mps=spread,
        white_sigma_mps=sigma(np.diff(values)) / np.sqrt(2.0),
        p95_mps=float(np.quantile(size, 0.95)),
        p99_mps=float(np.quantile(size, 0.99)),
        max_mps=float(size.max()),
        beyond_3_sigma=float(np.mean(beyond)),
        blocks=count,
        independent=len(values) / _lasting_size(values - middle),
    )


def _lasting_size(noise: Array) -> float:
    """Correlation time of the size of Gaussian noise (n,), in pings: its correlations are the squares of the noise's.

    The correlation is that of the signs, which outliers do not sway; sin(π r / 2) for Gaussian noise.
    """
    signs, total = np.sign(noise), 1.0
    for lag in range(1, len(noise) // 4):
        r = float(np.sin(0.5 * np.pi * np.mean(signs[lag:] * signs[:-lag])))
        if r < 2.0 / np.sqrt(len(noise)):
            break
        total += 2.0 * r**2
    return total


@dataclass(frozen=True, eq=False)
class Slope:
    """Regression of the closure on the velocity.

    Attributes:
        slope: (3,).
        cov: (3, 3) its covariance.
        pings: number of pings used.
        lag: pings between a ping and the neighbours that serve as instrumental variable.
        blocks: independent blocks behind the covariance.
        reduced: (3,) coefficients of the closure on the instrumental variable itself.
        reduced_cov: (3, 3) their covariance.
        first: (3, 3) coefficients of the velocity on the instrumental variable: `reduced` = `first` × `slope`.
    """

    slope: Array
    cov: Array
    pings: int
    lag: int = 1
    blocks: int = 50
    reduced: Array | None = None
    reduced_cov: Array | None = None
    first: Array | None = None

    @property
    def p_value(self) -> float:
        """Probability of a closure that depends so much on the velocity with the assumed beam matrix.

        Hotelling's T² over blocks of pings, of the coefficients on the instrumental variable: right however weakly that
        follows the velocity (Anderson and Rubin 1949).
        """
        free = self.blocks - 1
        if self.blocks < LEAST_BLOCKS:
            return 1.0
        values = self.slope if self.reduced is None else self.reduced
        cov = self.cov if self.reduced_cov is None else self.reduced_cov
        return float(f.sf(values @ np.linalg.solve(cov, values) * (free - 2) / (3 * free), 3, free - 2))

    def with_rows_uncertain(self, cov: Array) -> "Slope":
        """The same slope with the covariance (3, 3) that uncertain beam rows give it."""
        reduced = self.reduced_cov
        if reduced is not None and self.first is not None:
            reduced = reduced + self.first @ cov @ self.first.T
        return replace(self, cov=self.cov + cov, reduced_cov=reduced)


def _lag_of(noise: Array) -> int:
    """Least lag, in rows, from which on the noise (n,) is uncorrelated: below two deviations of white noise."""
    spread = max(sigma(noise), 1e-12)
    clipped = np.clip((noise - np.median(noise)) / spread, -3.0, 3.0)
    power = float(clipped @ clipped)
    for lag in range(1, min(100, len(noise) // 8)):
        if clipped[lag:] @ clipped[:-lag] < 2.0 / np.sqrt(len(noise)) * power:
            return lag
    return min(100, max(1, len(noise) // 8))


def closure_slope(values_mps: Array, velocity_mps: Array, row: NDArray[np.int64]) -> Slope | None:
    """Slope of the closure (n,) on the velocity (n, 3) of full pings at rows (n,) of the log; None from too few pings.

    The velocity of the same ping has the noise of the same beams, which correlates with the closure where one beam is
    noisier than another. The mean of two pings before and after shares the motion but not the noise: it is the
    instrumental variable of a two-stage fit. The two are as far away as the noise of consecutive pings is correlated.
    """
    ones = np.ones((len(row), 1))
    lag = _lag_of(fit_linear(np.hstack([velocity_mps, ones]), values_mps).residuals)
    place = np.full(int(row[-1]) + 1 + lag, -1)
    place[row] = np.arange(len(row))
    before, after = np.where(row >= lag, place[row - lag], -1), place[row + lag]
    inner = np.flatnonzero((before >= 0) & (after >= 0))
    if inner.size < 100:
        return None
    one = np.ones((inner.size, 1))
    beside = np.hstack([0.5 * (velocity_mps[before[inner]] + velocity_mps[after[inner]]), one])
    velocity = np.hstack([velocity_mps[inner], one])
    fit = fit_linear(velocity, values_mps[inner], beside)
    reduced = fit_linear(beside, values_mps[inner])
    tiny = 1e-18 * np.eye(3)
    return Slope(
        fit.parameters[:3],
        np.atleast_2d(np.cov(fit.resampled[:, :3], rowvar=False)) + tiny,
        inner.size,
        lag,
        min(fit.blocks, reduced.blocks),
        reduced.parameters[:3],
        np.atleast_2d(np.cov(reduced.resampled[:, :3], rowvar=False)) + tiny,
        np.linalg.lstsq(beside, velocity, rcond=None)[0][:3, :3],
    )


def null_space_cov(rows: Array, resampled: Array, weights: Array) -> Array:
    """(3, 3) covariance that the uncertainty of the rows gives the slope of the closure `weights` (beams,).

    The null space n_r of a resampled matrix A_r, seen by the true beams A, has the slope n_rᵀ A.
    """
    slopes = []
    for copy in resampled:
        n = null_space(copy)
        k = int(np.argmax(np.abs(weights @ n)))
        slopes.append((n[:, k] * (weights @ weights) / (weights @ n[:, k])) @ rows)
    return np.atleast_2d(np.cov(np.array(slopes), rowvar=False))
