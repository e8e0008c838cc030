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
from scipy.stats import chi2, f, norm

from bottomlock.audit.robust import BLOCKS, Array, fit_linear, resolution, sigma

GAUSSIAN_BEYOND_3 = float(2.0 * norm.sf(3.0))


def null_space(rows: Array) -> Array:
    """(beams, beams − 3) basis of the left null space, each column scaled so that its (first) largest entry is 1.

    >>> null_space(np.array([[1.0, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]])).round(9).T.tolist()
    [[1.0, -1.0, 1.0, -1.0]]
    """
    left = np.linalg.svd(rows)[0][:, 3:]
    if not left.size:
        return np.zeros((len(rows), 0))
    largest = np.argmax(np.abs(left) > np.abs(left).max(axis=0) * (1.0 - 1e-2), axis=0)
    return np.asarray(left / left[largest, np.arange(left.shape[1])])


@dataclass(frozen=True, eq=False)
class Closure:
    """Statistics of the closure over full pings, m/s.

    `beyond_3_sigma` is the fraction beyond three robust sigmas and two steps of resolution: 0.0027 for Gaussian noise.
    `white_sigma_mps` is the spread of the part that changes from ping to ping, from first differences.
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

    @property
    def beam_sigma_mps(self) -> float:
        """Noise of one beam, m/s, 1 sigma, if all beams are equally noisy."""
        return self.sigma_mps / float(np.linalg.norm(self.weights))


def closure_of(weights: Array, readings_mps: Array) -> Closure:
    """Statistics of the combination `weights` (beams,) over readings (n, beams) of full pings."""
    values = readings_mps @ weights
    size = np.abs(values)
    spread, middle = sigma(values), float(np.median(values))
    # The median of rounded values may be one step off, and three sigmas with it.
    coarse = 2.0 * max(resolution(column) for column in readings_mps.T)
    blocks = np.array_split(values, max(1, min(25, len(values) // 8)))
    # Medians of consecutive blocks: noise that is correlated over several pings widens their spread as it should.
    middle_sd = float(1.2533 * np.std([np.median(block) for block in blocks], ddof=1) / np.sqrt(len(blocks)))
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
        beyond_3_sigma=float(np.mean(np.abs(values - middle) > 3.0 * max(spread, 1e-12) + coarse)),
    )


@dataclass(frozen=True, eq=False)
class Slope:
    """Regression of the closure on the velocity: slope (3,) and covariance (3, 3), from `pings` pings."""

    slope: Array
    cov: Array
    pings: int

    @property
    def p_value(self) -> float:
        """Probability of a slope this large with the assumed beam matrix (Hotelling's T² over blocks of pings)."""
        free = BLOCKS - 1
        return float(
            f.sf(self.slope @ np.linalg.solve(self.cov, self.slope) * (free - 2) / (3 * free), 3, free - 2)
        )


def closure_slope(values_mps: Array, velocity_mps: Array, row: NDArray[np.int64]) -> Slope | None:
    """Slope of the closure (n,) on the velocity (n, 3) of full pings at rows (n,) of the log; None from too few pings.

    The velocity of the same ping has the noise of the same beams, which correlates with the closure where one beam is
    noisier than another. The mean of the pings before and after shares the motion but not the noise: it is the
    instrumental variable of a two-stage fit.
    """
    inner = np.flatnonzero((np.diff(row[:-1]) == 1) & (np.diff(row[1:]) == 1)) + 1
    if inner.size < 100:
        return None
    one = np.ones((inner.size, 1))
    beside = 0.5 * (velocity_mps[inner - 1] + velocity_mps[inner + 1])
    fit = fit_linear(np.hstack([velocity_mps[inner], one]), values_mps[inner], np.hstack([beside, one]))
    copies = fit.resampled[:, :3]
    return Slope(
        fit.parameters[:3], np.atleast_2d(np.cov(copies, rowvar=False)) + 1e-18 * np.eye(3), inner.size
    )


@dataclass(frozen=True)
class Suspect:
    """One beam that would explain a slope: its direction off by `angle_rad`, or its scale off by `scale`."""

    beam: int
    angle_rad: float
    angle_sd_rad: float
    tilt_change_rad: float
    scale: float
    p_turned: float
    p_scaled: float


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


def suspects(slope: Slope, weights: Array, rows: Array) -> list[Suspect]:
    """Single beams that would explain the slope, the best first.

    If beam k alone is off by δ, the least-squares velocity is A⁺ (A + e_k δᵀ) v, and the slope a on that velocity obeys
    (n − A⁺ᵀ a)ᵀ (A + e_k δᵀ) = 0, so that δ = a / (n − A⁺ᵀ a)_k. A wrong direction keeps the row's length (one test); a
    wrong scale keeps its direction (two tests).
    """
    found = []
    for beam, weight in enumerate(weights - np.linalg.pinv(rows).T @ slope.slope):
        if abs(weight) < 0.1:
            continue
        delta, cov, row = slope.slope / weight, slope.cov / weight**2, rows[beam]
        length = float(np.linalg.norm(row))
        unit, new = row / length, row + delta
        grown = np.linalg.norm(new) - length
        along = new / max(float(np.linalg.norm(new)), 1e-12)
        p_turned = float(chi2.sf(grown**2 / max(float(along @ cov @ along), 1e-18), 1))
        across = np.linalg.svd(unit[None])[2][1:]
        side = across @ delta
        p_scaled = float(chi2.sf(side @ np.linalg.solve(across @ cov @ across.T, side), 2))
        cosine = float(np.clip(unit @ along, -1.0, 1.0))
        turned = float(np.arctan2(np.hypot(along[0], along[1]), along[2]))
        before = float(np.arctan2(np.hypot(unit[0], unit[1]), unit[2]))
        scale = float(unit @ delta) / length
        across_unit = along - cosine * unit
        across_unit = across_unit / max(float(np.linalg.norm(across_unit)), 1e-12)
        angle_sd = float(np.sqrt(across_unit @ cov @ across_unit)) / length
        found.append(
            Suspect(beam, float(np.arccos(cosine)), angle_sd, turned - before, scale, p_turned, p_scaled)
        )
    return sorted(found, key=lambda one: -max(one.p_turned, one.p_scaled))
