"""Updates with heavy-tailed noise as their papers write them: dense, in the space of the state, nothing exploited."""

import itertools

import numpy as np
import scipy.linalg
import scipy.stats

from tests.oracle import kalman
from tests.oracle.rotations import Array


def student_t(P: Array, H: Array, sd: Array, z: Array, degrees: float) -> tuple[Array, Array, Array]:
    """Correction, covariance and weights of the variational update (Agamennoni et al. 2012), one weight per reading.

    In turn: the state given the weights, a Kalman update with variances sd²/w; the weights given the state,
    w = (ν + 1) / (ν + E[(z − H x)²]/sd²), the expectation over the state's own posterior.
    """
    w = np.ones(len(z))
    for _ in range(2000):
        x, posterior = kalman.update(np.zeros(len(P)), P, H, np.diag(sd**2 / w), z)
        expected = (z - H @ x) ** 2 + np.diag(H @ posterior @ H.T)
        w = (degrees + 1) / (degrees + expected / sd**2)
    x, posterior = kalman.update(np.zeros(len(P)), P, H, np.diag(sd**2 / w), z)
    return x, posterior, w


def passes(S: Array, A: Array, z: Array, probability: float) -> bool:
    """Whether the closure of the beams `A` (n, 3) and each of them against the others pass at this probability."""
    null = scipy.linalg.null_space(A.T)
    if null.size:
        gap = null.T @ z
        closure = gap @ np.linalg.solve(null.T @ S @ null, gap)
        if closure > scipy.stats.chi2.ppf(probability, null.shape[1]):
            return False
    whole = z @ np.linalg.solve(S, z)
    for beam in range(len(z)):
        rest = np.delete(np.arange(len(z)), beam)
        without = z[rest] @ np.linalg.solve(S[np.ix_(rest, rest)], z[rest]) if rest.size else 0.0
        if whole - without > scipy.stats.chi2.ppf(probability, 1):
            return False
    return True


def screened(P: Array, H: Array, A: Array, sd: Array, z: Array, probability: float) -> Array:
    """(n,) part of its information that each beam keeps: the fewest go, by odds of 20 to 1, and at most half."""
    S, beams = H @ P @ H.T + np.diag(sd**2), np.arange(len(z))
    if passes(S, A, z, probability):
        return np.ones(len(z))
    is_redundant = len(z) > np.linalg.matrix_rank(A)
    for count in range(1, len(z) // 2 + 1 if is_redundant else len(z)):
        nis = {}
        for gone in itertools.combinations(beams, count):
            rest = np.setdiff1d(beams, gone)
            nis[gone] = z[rest] @ np.linalg.solve(S[np.ix_(rest, rest)], z[rest])
        first, second = sorted(nis, key=nis.__getitem__)[:2]
        rest = np.setdiff1d(beams, first)
        if passes(S[np.ix_(rest, rest)], A[rest], z[rest], probability):
            if not is_redundant or nis[second] - nis[first] >= 2.0 * np.log(20.0):
                return np.isin(beams, rest).astype(float)
            null = scipy.linalg.null_space(A.T)
            gap = null.T @ z
            closure = gap @ np.linalg.solve(null.T @ S @ null, gap) / null.shape[1] if null.size else 1.0
            return np.full(len(z), 1.0 / max(closure, 1.0))
    return np.zeros(len(z))
