"""Bounds of a covariance for receivers that take less than all of it: a diagonal D, or one variance, with D - P >= 0.

The diagonal of P itself is no bound: along the axis in which errors are correlated, the receiver would take less than
the true variance. Any positive numbers u give a bound by weighted diagonal dominance,

    D_i = sum over j of |P_ij| u_j / u_i,

because D - P then has a non-negative diagonal that outweighs each row (Horn & Johnson, Matrix Analysis, 6.1). Of these
the smallest determinant, hence the least loss of information, has u_i^2 D_i = 1: |P| scaled to unit row sums
(Sinkhorn), which a few iterations find. If there is an axis along which all correlations add (P_12 P_13 P_23 >= 0), no
diagonal bound has a smaller determinant: D - P is then singular along u, and Z = u u' with Z_ii = 1 / D_i meets the
optimality conditions. If there is none and n = 3, a multiple of P's own diagonal, the largest eigenvalue of its
correlation matrix, can be smaller; the smaller of the two is used.

Both hold for whatever u the iteration ends with. The bound is enlarged by `GUARD`, a thousand times the rounding of
its own computation, so that it holds for the numbers as they are, however ill-conditioned P is.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

GUARD = 1e-12
"""Relative enlargement of every bound, a thousand times the relative error of its computation, below 1e-15."""

_ITERATIONS = 12


def diagonal_bound(covariance: Floats) -> Floats:
    """Diagonal (n,) of a D with D - P >= 0, for a covariance P (n, n) without NaN.

    >>> diagonal_bound(np.array([[1.0, 0.09], [0.09, 0.01]])).round(6).tolist()
    [1.9, 0.019]
    """
    variance = np.diag(covariance)
    size = len(variance)
    if size == 0 or not bool((variance > 0.0).all()):
        # An axis without variance has no correlation; rows of zeros need no bound.
        keep = variance > 0.0
        bound = np.zeros(size)
        if keep.any():
            bound[keep] = diagonal_bound(covariance[np.ix_(keep, keep)])
        return bound
    best = _dominance(np.abs(covariance))
    if size == 3 and covariance[0, 1] * covariance[0, 2] * covariance[1, 2] < 0.0:
        sd = np.sqrt(variance)
        largest = float(np.linalg.eigvalsh(covariance / np.outer(sd, sd))[-1])
        if largest**size < float(np.prod(best / variance)):
            best = largest * variance
    return best * (1.0 + GUARD)


def _dominance(size: Floats) -> Floats:
    """Row sums of |P| weighted so that their product is smallest."""
    weight = 1.0 / np.sqrt(np.diag(size))
    for _ in range(_ITERATIONS):
        weight = np.sqrt(weight / (size @ weight))
    bound: Floats = size @ weight / weight
    return bound


def scalar_bound(covariance: Floats) -> float:
    """Variance s with s I - P >= 0: the largest eigenvalue, enlarged by the guard.

    >>> round(scalar_bound(np.array([[1.0, 0.5], [0.5, 1.0]])), 9)
    1.5
    """
    return float(np.linalg.eigvalsh(covariance)[-1]) * (1.0 + GUARD)


def single_at_least(value: float) -> float:
    """The smallest 32-bit float that is not below a number: a bound stays one in a message of such floats.

    >>> single_at_least(0.1) >= 0.1
    True
    """
    nearest = np.float32(value)
    return float(nearest if float(nearest) >= value else np.nextafter(nearest, np.float32(np.inf)))
