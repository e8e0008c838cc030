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
from scipy.stats import chi2, f, norm

from bottomlock.audit.robust import (
    LEAST_BLOCKS,
    Array,
    blocks_of,
    fit_linear,
    resolution,
    sigma,
)
from bottomlock.recordings.closure import closure_rows
from bottomlock.statistics.correlation import correlation_rows

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


@dataclass(frozen=True)
class Suspect:
    """One beam that would explain a slope: its direction off by `angle_rad`, or its scale off by `scale`.

    `share_turned` and `share_scaled` are the probabilities of either, of all single beams, equal before the log (BIC).
    """

    beam: int
    angle_rad: float
    angle_sd_rad: float
    tilt_change_rad: float
    scale: float
    p_turned: float
    p_scaled: float
    scale_sd: float = 0.0
    share_turned: float = 0.0
    share_scaled: float = 0.0


def _suspect(beam: int, delta: Array, cov: Array, row: Array) -> Suspect:
    """A beam whose row is off by `delta` (3,) with this covariance: what of it a direction or a scale explains.

    Each is the generalised least-squares estimate under its constraint: the part of `delta` that the motion excites
    little is left to the constraint.
    """
    length = float(np.linalg.norm(row))
    unit, new = row / length, row + delta
    along = new / max(float(np.linalg.norm(new)), 1e-12)
    grown, given = float(np.linalg.norm(new) - length), max(float(along @ cov @ along), 1e-18)
    kept = new - cov @ along * grown / given
    kept = kept / max(float(np.linalg.norm(kept)), 1e-12)
    cosine = float(np.clip(unit @ kept, -1.0, 1.0))
    aside = kept - cosine * unit
    aside = aside / max(float(np.linalg.norm(aside)), 1e-12)
    cov_kept = cov - np.outer(cov @ along, cov @ along) / given
    turned, before = (float(np.arctan2(np.hypot(v[0], v[1]), v[2])) for v in (np.asarray(kept), unit))
    weighted = np.linalg.solve(cov, row)
    scale, scale_sd = float(weighted @ delta / (weighted @ row)), float(1.0 / np.sqrt(weighted @ row))
    left = np.asarray(delta - scale * row)
    return Suspect(
        beam, float(np.arccos(cosine)),
        float(np.sqrt(max(float(aside @ cov_kept @ aside), 0.0))) / length, turned - before, scale,
        float(chi2.sf(grown**2 / given, 1)), float(chi2.sf(left @ np.linalg.solve(cov, left), 2)), scale_sd,
    )  # fmt: skip


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
        found.append(_suspect(beam, slope.slope / weight, slope.cov / weight**2, rows[beam]))
    # A direction has two numbers, a scale one.
    pairs = [
        (chi2.isf(max(one.p_turned, 1e-300), 1), chi2.isf(max(one.p_scaled, 1e-300), 2)) for one in found
    ]
    cost = np.array([(t + 2.0 * np.log(slope.pings), s + np.log(slope.pings)) for t, s in pairs])
    weight = np.exp(-0.5 * (cost - cost.min()))
    shares = np.asarray(weight / weight.sum())
    told = [
        replace(one, share_turned=float(t), share_scaled=float(s))
        for one, (t, s) in zip(found, shares, strict=True)
    ]
    return sorted(told, key=lambda one: -max(one.share_turned, one.share_scaled))
