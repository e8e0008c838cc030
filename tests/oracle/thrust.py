"""A speed by the drives as its equation stands: e_k'(v - R'c) = a n + s + noise, over all states that it has.

The states are the 20 of the error state, scale a and slip s along the axis, and the current c, north and east.
"""

import numpy as np

from tests.oracle.rotations import Array, skew

STATES = 24
MISALIGNMENT, VELOCITY = slice(3, 6), slice(6, 9)
SCALE, SLIP, CURRENT = 20, 21, slice(22, 24)


def residual(
    axis: Array, n: float, scale: float, slip: float, velocity_p: Array, attitude_t_p: Array, current: Array
) -> float:
    """What the drives say of the speed through the water along an axis beyond what is expected of it."""
    return scale * n + slip - float(axis @ (velocity_p - attitude_t_p.T @ np.append(current, 0.0)))


def jacobian(axis: Array, n: float, attitude_t_p: Array, current: Array) -> Array:
    """With R = Exp([rho x]) R^: v - R'(c + c x rho); the yaw is the current's own."""
    H = np.zeros((1, STATES))
    axis_t = attitude_t_p @ axis
    H[0, VELOCITY] = axis
    H[0, MISALIGNMENT] = -axis_t @ skew(np.append(current, 0.0))
    H[0, MISALIGNMENT.stop - 1] = 0.0
    H[0, SCALE], H[0, SLIP] = -n, -1.0
    H[0, CURRENT] = -axis_t[:2]
    return H


def without_slip(n: float, z: float, P: Array, H: Array, R: float, scale: float) -> float:
    """The speed less ten times what slip and noise have of the innovation, and at most all of it."""
    S = float((H @ P @ H.T)[0, 0]) + R
    return n - z * min(10.0 * (float(P[SLIP, SLIP]) + R) / S, 1.0) / scale


def update(P: Array, H: Array, R: float, z: float, corrected: Array) -> tuple[Array, Array]:
    """Schmidt's update: the gain of the states that are not corrected is zero; Joseph's form of the covariance."""
    S = float((H @ P @ H.T)[0, 0]) + R
    K = (P @ H.T / S) * corrected[:, None]
    left = np.eye(STATES) - K @ H
    return K[:, 0] * z, left @ P @ left.T + K @ K.T * R
