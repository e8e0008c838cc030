"""The Kalman filter as a textbook writes it: dense matrices, plain inverses, nothing exploited."""

import numpy as np
from scipy.linalg import expm

from tests.oracle.rotations import Array, skew


def predict(P: Array, Phi: Array, Qd: Array) -> Array:
    """P⁻ = Φ P Φᵀ + Qd."""
    return Phi @ P @ Phi.T + Qd


def van_loan(F: Array, GQG: Array, dt_s: float) -> tuple[Array, Array]:
    """Φ and Qd of a constant F over dt, from one matrix exponential (Van Loan 1978)."""
    n = len(F)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n] = -F
    block[:n, n:] = GQG
    block[n:, n:] = F.T
    exponential = expm(block * dt_s)
    Phi = exponential[n:, n:].T
    return Phi, Phi @ exponential[:n, n:]


def update(x: Array, P: Array, H: Array, R: Array, residual: Array) -> tuple[Array, Array]:
    """Correction of an estimate x by a residual z − h(x̂) with independent noise."""
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    return x + K @ residual, (np.eye(len(P)) - K @ H) @ P


def update_position(
    x: Array, P: Array, H: Array, R: Array, residual: Array, known_m2: float
) -> tuple[Array, Array, Array]:
    """A position fix at the corrected path (docs/linear_range.md): estimate, covariance, and the H that was used.

    With δr̂ of a first update, B = −[γ δr̂×], and M the identity with B at position by misalignment: H' = H M, then
    x ← M x⁺ and P ← M P⁺ Mᵀ. Of the level position's variance `known_m2` were there when it was last known.
    """
    first, _ = update(x, P, H, R, residual)
    M = np.eye(len(P))
    M[0:3, 3:6] = -skew((1.0 - known_m2 / (P[0, 0] + P[1, 1])) * first[0:3])
    moved, after = update(x, P, H @ M, R, residual)
    return M @ moved, M @ after @ M.T, H @ M


def nis(H: Array, P: Array, R: Array, residual: Array) -> float:
    """Normalised innovation squared."""
    return float(residual @ np.linalg.inv(H @ P @ H.T + R) @ residual)
