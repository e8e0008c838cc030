"""Scores of Gaussian answers against the truth, a value a row; the best answer has the least score.

The negative log-likelihood and the energy score are proper: in the mean over the truths that an answer claims, no other
answer scores better (Gneiting and Raftery 2007, J. Am. Stat. Assoc. 102, 359-378).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SAMPLES = 256
"""Samples of the energy score, the same for every row, method and machine."""
SAMPLES_SEED = 19


def negative_log_likelihood(error: Floats, cov: Floats) -> Floats:
    """½ (d log 2π + log det P + eᵀ P⁻¹ e) in nats, of errors (n, d) with covariances (n, d, d): (n,).

    Examples:
        >>> one = negative_log_likelihood(np.zeros((1, 1)), np.ones((1, 1, 1)))
        >>> float(one[0].round(4))
        0.9189
    """
    factor = np.linalg.cholesky(cov)
    white = np.linalg.solve(factor, error[..., None])[..., 0]
    log_det = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    return np.asarray(0.5 * (error.shape[1] * np.log(2.0 * np.pi) + log_det + (white**2).sum(axis=1)))


def energy_score(error: Floats, cov: Floats) -> Floats:
    """E|X - y| - ½ E|X - X′|, X and X′ independent of the answer, in the units of the error: (n,).

    Both expectations are means over the same standard normal samples z and -z: X = m + L z with L Lᵀ = P, and X - X′ is
    distributed as √2 L z. For a certain answer it is the norm of the error.

    Examples:
        >>> float(energy_score(np.array([[3.0, 4.0]]), np.full((1, 2, 2), 1e-18) * np.eye(2)).round(6)[0])
        5.0
    """
    factor = np.linalg.cholesky(cov)
    total = np.empty(len(error))
    samples = _samples(error.shape[1])
    # In parts, which memory can hold.
    for first in range(0, len(error), 4096):
        part = slice(first, first + 4096)
        spread = np.einsum("nij,sj->nsi", factor[part], samples)
        reach = np.linalg.norm(error[part, None, :] + spread, axis=2).mean(axis=1)
        within = np.linalg.norm(spread, axis=2).mean(axis=1)
        total[part] = reach - np.sqrt(0.5) * within
    return total


def nees(error: Floats, cov: Floats) -> Floats:
    """eᵀ P⁻¹ e, (n,), whose mean is d for a consistent answer."""
    return np.asarray(np.einsum("ni,ni->n", error, np.linalg.solve(cov, error[..., None])[..., 0]))


def drift_percent(position_m: Floats, truth_m: Floats, segment_m: float) -> Floats:
    """Horizontal error gained over segments of this true distance travelled, in percent of it: (segments,).

    Segments follow each other; the displacement over each is compared with the true one, so that an error made before
    it does not count again.

    Examples:
        >>> way = np.stack([np.arange(0.0, 201.0, 10.0), np.zeros(21), np.zeros(21)], axis=1)
        >>> drift_percent(way * [1.01, 1.0, 1.0], way, 100.0).round(6).tolist()
        [1.0, 1.0]
    """
    steps = np.linalg.norm(np.diff(truth_m[:, :2], axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    count = int(travelled[-1] // segment_m)
    # The least time at which each whole number of segments has been travelled; rounding must not lose the last.
    ends = np.searchsorted(travelled, segment_m * np.arange(count + 1) * (1.0 - 1e-12))
    error = (position_m - truth_m)[ends, :2]
    distance = np.diff(travelled[ends])
    return np.asarray(100.0 * np.linalg.norm(np.diff(error, axis=0), axis=1) / distance)


@lru_cache(maxsize=4)
def _samples(size: int) -> Floats:
    half = np.random.default_rng([SAMPLES_SEED, size]).standard_normal((SAMPLES // 2, size))
    return np.concatenate([half, -half])
