"""Closure: the combinations of the beams to which no velocity contributes, and what they show of the instrument.

With A (beams, 3) and N its left null space, `Nᵀ y = Nᵀ (bias + noise)`; the closure of a Janus is 1 − 2 + 3 − 4 in the
order of azimuth. A closure that depends on the velocity shows that the true beam matrix is not A:
`E[n · y | v] = nᵀ (A_true − A) v`.

Limits of observability: A and A·T have the same null space for every invertible T (3, 3). Closure thus leaves 9 of the
12 entries of four beams free; with unit beams it leaves 5 (three rotations of the whole and two stretches that trade
tilt against azimuth). Of the 24 orders of four Janus beams it distinguishes 3 classes of 8; of four biases it observes
one combination.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, f, norm

from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_SCALE, SIGNIFICANCE
from bottomlock.audit.logs import Array
from bottomlock.audit.robust import LEAST_BLOCKS, fit_linear, resolution, significant
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.robust import blocks_of, correlation_rows, sd_about_median, white_sd

HEAVY_FRACTION = 0.01
"""Tails are heavy where a larger fraction lies beyond three robust sigmas; Gaussian noise has 0.0027."""


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

    @property
    def biased(self) -> bool:
        """The median is no zero."""
        return bool(significant(self.median_mps, self.median_sd_mps, self.blocks, MATERIAL_MPS))

    @property
    def heavy(self) -> bool:
        """Gaussian noise hardly has as many pings beyond three robust sigmas.

        Correlated pings are worth fewer, and the robust sigma is itself known to 1.17 / √n only: the mean over its
        errors.
        """
        worth = max(self.independent, 2.0)
        error = np.linspace(-6.0, 6.0, 121)
        beyond = 2.0 * norm.sf(3.0 * np.maximum(1.0 + error * 1.17 / np.sqrt(worth), 0.0))
        tails = binom.sf(round(self.beyond_3_sigma * worth) - 1, round(worth), np.minimum(beyond, 1.0))
        chance = float(np.average(tails, weights=norm.pdf(error)))
        return self.beyond_3_sigma > HEAVY_FRACTION and chance < SIGNIFICANCE


def closure_of(weights: Array, readings_mps: Array, added_sd_mps: float = 0.0) -> Closure:
    """Statistics of the combination `weights` (beams,) over readings (n, beams) of full pings.

    Args:
        weights, readings_mps: as said.
        added_sd_mps: 1 sigma of the median by uncertain weights.
    """
    values = readings_mps @ weights
    size = np.abs(values)
    spread, middle = float(sd_about_median(values)), float(np.median(values))
    # The median of rounded values may be one step off, and three sigmas with it.
    coarse = 2.0 * max(resolution(column) for column in readings_mps.T)
    member = blocks_of(len(values), max(correlation_rows(np.sign(values - middle)), 2.0))
    count = int(member[-1]) + 1
    # Medians of consecutive blocks: noise that is correlated over several pings widens their spread as it should.
    medians = [np.median(values[member == block]) for block in range(count)]
    middle_sd = 1.2533 * float(np.std(medians, ddof=1)) / np.sqrt(count) if count >= LEAST_BLOCKS else np.inf
    half, p95, p99, largest = np.quantile(size, [0.5, 0.95, 0.99, 1.0]).tolist()
    return Closure(
        weights=weights, values_mps=values, pings=len(values), median_mps=middle,
        median_sd_mps=float(np.hypot(middle_sd, added_sd_mps)), median_abs_mps=half, sigma_mps=spread,
        white_sigma_mps=float(white_sd(values[:, None], 1)[0]), p95_mps=p95, p99_mps=p99, max_mps=largest,
        beyond_3_sigma=float(np.mean(np.abs(values - middle) > 3.0 * max(spread, 1e-12) + coarse)), blocks=count,
        # The size of Gaussian noise has the squares of its correlations.
        independent=len(values) / (1.0 + 2.0 * float(np.sum(_correlations(values) ** 2))),
    )  # fmt: skip


def _correlations(noise: Array) -> Array:
    """Correlations of Gaussian noise (n,) over 1, 2, ... rows, up to the first within two deviations of white noise's.

    They are those of the signs, which outliers do not sway.
    """
    signs, found = np.sign(noise - np.median(noise)), list[float]()
    for lag in range(1, len(noise) // 4):
        r = float(np.sin(0.5 * np.pi * np.mean(signs[lag:] * signs[:-lag])))
        if r < 2.0 / np.sqrt(len(noise)):
            break
        found.append(r)
    return np.array(found)


@dataclass(frozen=True, eq=False)
class Slope:
    """Regression of the closure on the velocity.

    Attributes:
        slope: (3,).
        cov: (3, 3) its covariance.
        pings: number of pings used.
        lag: pings between a ping and the neighbours that serve as instrumental variable.
        blocks: independent blocks behind the covariance.
        p_value: probability of a closure that depends so much on the velocity with the assumed beam matrix.
        effect_mps: RMS of the closure by the slope.
    """

    slope: Array
    cov: Array
    pings: int
    lag: int
    blocks: int
    p_value: float
    effect_mps: float

    @property
    def material(self) -> bool:
        """Significant, and of a size that matters.

        A beam of full weight that is off by a direction or a scale, rad or relative, gives a slope of that size.
        """
        large = np.linalg.norm(self.slope) >= MATERIAL_SCALE and self.effect_mps >= MATERIAL_MPS
        return bool(large and self.p_value <= SIGNIFICANCE)


def closure_slope(
    values_mps: Array, velocity_mps: Array, row: NDArray[np.int64], rows_cov: Array | float = 0.0
) -> Slope | None:
    """Slope of the closure (n,) on the velocity (n, 3) of full pings at rows (n,) of the log; None from too few pings.

    The velocity of the same ping has the noise of the same beams, which correlates with the closure where one beam is
    noisier than another. The mean of two pings before and after shares the motion but not the noise: it is the
    instrumental variable of a two-stage fit. The two are as far away as the noise of consecutive pings is correlated.

    The p-value is that of Hotelling's T² over blocks of pings, of the coefficients on the instrumental variable: right
    however weakly that follows the velocity (Anderson and Rubin 1949).

    Args:
        values_mps, velocity_mps, row: as said.
        rows_cov: (3, 3) covariance that uncertain beam rows give the slope.
    """
    one = np.ones((len(row), 1))
    noise = fit_linear(np.hstack([velocity_mps, one]), values_mps).residuals
    lag = min(100, max(1, len(noise) // 8), 1 + len(_correlations(noise)))
    place = np.full(int(row[-1]) + 1 + lag, -1)
    place[row] = np.arange(len(row))
    before, after = np.where(row >= lag, place[row - lag], -1), place[row + lag]
    inner = np.flatnonzero((before >= 0) & (after >= 0))
    if inner.size < 100:
        return None
    one = one[: inner.size]
    beside = np.hstack([0.5 * (velocity_mps[before[inner]] + velocity_mps[after[inner]]), one])
    velocity = np.hstack([velocity_mps[inner], one])
    fit, reduced = fit_linear(velocity, values_mps[inner], beside), fit_linear(beside, values_mps[inner])
    tiny = 1e-18 * np.eye(3)
    cov, reduced_cov = (np.cov(of.resampled[:, :3], rowvar=False) + tiny for of in (fit, reduced))
    first = np.linalg.lstsq(beside, velocity, rcond=None)[0][:3, :3]
    reduced_cov = reduced_cov + first @ (rows_cov * np.ones((3, 3))) @ first.T
    slope, shown, blocks = fit.parameters[:3], reduced.parameters[:3], min(fit.blocks, reduced.blocks)
    squared, free = float(shown @ np.linalg.solve(reduced_cov, shown)), blocks - 1
    p_value = float(f.sf(squared * (free - 2) / (3 * free), 3, free - 2)) if blocks >= LEAST_BLOCKS else 1.0
    effect = float(np.sqrt(slope @ np.cov(velocity_mps, rowvar=False) @ slope))
    return Slope(slope, cov + rows_cov, inner.size, lag, blocks, p_value, effect)


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
