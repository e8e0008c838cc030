"""D - P >= 0 for every covariance, in exact arithmetic; and D is not larger than it must be."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from bottomlock.ports.over_bound import GUARD, diagonal_bound, scalar_bound, single_at_least

Floats = NDArray[np.float64]


def covariances(seed: int, count: int) -> list[Floats]:
    """Random covariances of rank 1 to 3, with σ over eight decades and condition numbers up to 1e30."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        factor = rng.standard_normal((3, int(rng.integers(1, 4)))) * 10.0 ** rng.uniform(-4.0, 4.0, (3, 1))
        matrix = factor @ factor.T
        if rng.random() < 0.5:
            matrix += np.diag((10.0 ** rng.uniform(-12.0, 0.0)) * np.diag(matrix))
        found.append(0.5 * (matrix + matrix.T))
    return found


def is_semidefinite(diagonal: list[float], covariance: Floats) -> bool:
    """Whether diag(D) - P has no negative eigenvalue: all principal minors, in rational arithmetic."""
    m = [
        [Fraction(diagonal[i] if i == j else 0.0) - Fraction(float(covariance[i, j])) for j in range(3)]
        for i in range(3)
    ]
    pairs = [m[i][i] * m[j][j] - m[i][j] ** 2 for i, j in ((0, 1), (0, 2), (1, 2))]
    whole = (
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] ** 2)
        - m[0][1] * (m[0][1] * m[2][2] - m[1][2] * m[0][2])
        + m[0][2] * (m[0][1] * m[1][2] - m[1][1] * m[0][2])
    )
    return min(m[0][0], m[1][1], m[2][2], *pairs, whole) >= 0


def test_bounds_hold_exactly() -> None:
    """The law: no rounding is forgiven, because the guard is larger than all of it."""
    for covariance in covariances(20_261, 3000):
        assert is_semidefinite(diagonal_bound(covariance).tolist(), covariance), covariance.tolist()
        assert is_semidefinite([scalar_bound(covariance)] * 3, covariance), covariance.tolist()


def test_the_guard_is_needed_and_enough() -> None:
    """Without it, rounding leaves some bound short; the test would otherwise not notice its loss."""
    short = [
        not is_semidefinite((diagonal_bound(covariance) / (1.0 + 2.0 * GUARD)).tolist(), covariance)
        for covariance in covariances(4, 200)
    ]
    assert sum(short) > 150


def log_det_optimum(covariance: Floats) -> float:
    """Smallest log det(D) / det(diag P), by a search over scaled largest eigenvalues: every bound is one of these."""
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)

    def excess(x: Floats) -> float:
        scale = np.exp(np.array([x[0], x[1], -x[0] - x[1]]))
        return 3.0 * float(np.log(np.linalg.eigvalsh(correlation * np.outer(scale, scale))[-1]))

    starts = np.random.default_rng(0).normal(0.0, 1.0, (4, 2))
    options = {"xatol": 1e-8, "fatol": 1e-11, "maxiter": 2000}
    return min(float(minimize(excess, s, method="Nelder-Mead", options=options).fun) for s in starts)


def test_the_bound_is_tight() -> None:
    """With an axis along which all correlations add the determinant is the smallest; else within 0.3 nat of it."""
    rng = np.random.default_rng(9)
    count, plain, excess = 25, 0, []
    for _ in range(count):
        factor = rng.standard_normal((3, 3)) * 10.0 ** rng.uniform(-2.0, 1.0, (3, 1))
        covariance = factor @ factor.T
        found = float(np.log(np.prod(diagonal_bound(covariance) / np.diag(covariance))))
        gap = 0.5 * (found - log_det_optimum(covariance))
        if covariance[0, 1] * covariance[0, 2] * covariance[1, 2] >= 0.0:
            plain += 1
            assert abs(gap) < 1e-6
        else:
            excess.append(gap)
    assert plain > count // 2
    assert min(excess) > -1e-6
    assert max(excess) < 0.3


def test_a_single_precision_bound_is_not_below() -> None:
    values = 10.0 ** np.random.default_rng(5).uniform(-8.0, 4.0, 5000)
    rounded = np.array([single_at_least(float(value)) for value in values])
    assert bool((rounded >= values).all())
    np.testing.assert_array_equal(rounded, rounded.astype(np.float32).astype(np.float64))
    np.testing.assert_allclose(rounded, values, rtol=1.3e-7)
