"""Tal et al. 2017, Eqs. 2-11: F and G written block by block as dense matrices, right as erratum E8 states.

The second derivation, which knows none of these blocks, is in `nonlinear_error.py`.
"""

import numpy as np

from tests.oracle.rotations import Array, skew

# Eq. 2 and Eq. 8.
R_, RHO, V, BA, BG, BDVL, SF = (
    slice(0, 3),
    slice(3, 6),
    slice(6, 9),
    slice(9, 12),
    slice(12, 15),
    slice(15, 19),
    slice(19, 20),
)
# Eqs. 6 and 11.
WA, WG, WBA, WBG, WDVL = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 17)


def f_ins(rotation: Array, velocity: Array, rate_ip: Array, gravity: Array, earth_rate_t: Array) -> Array:
    """Eq. 4, 15 × 15.

    `rotation` maps platform to tangent; `velocity` and the inertial rate `rate_ip` are in the platform frame;
    `gravity` and `earth_rate_t` in the tangent frame. Printed with OCR in place of v in the blocks (1,2) and (3,5).
    """
    earth_rate_p = rotation.T @ earth_rate_t
    F = np.zeros((15, 15))
    F[R_, RHO] = -skew(rotation @ velocity)
    F[R_, V] = rotation
    F[RHO, RHO] = -skew(earth_rate_t)
    F[RHO, BG] = -rotation
    F[V, RHO] = rotation.T @ skew(gravity) + skew(velocity) @ rotation.T @ skew(earth_rate_t)
    F[V, V] = -skew(rate_ip + earth_rate_p)
    F[V, BA] = -np.eye(3)
    F[V, BG] = -skew(velocity)
    return F


def g_ins(rotation: Array, velocity: Array) -> Array:
    """Eq. 5, 15 × 12."""
    G = np.zeros((15, 12))
    G[RHO, WG] = -rotation
    G[V, WA] = -np.eye(3)
    G[V, WG] = -skew(velocity)
    G[BA, WBA] = np.eye(3)
    G[BG, WBG] = np.eye(3)
    return G


def f_full(rotation: Array, velocity: Array, rate_ip: Array, gravity: Array, earth_rate_t: Array) -> Array:
    """Eq. 9, 20 × 20."""
    F = np.zeros((20, 20))
    F[:15, :15] = f_ins(rotation, velocity, rate_ip, gravity, earth_rate_t)
    return F


def g_full(rotation: Array, velocity: Array) -> Array:
    """Eq. 10, 20 × 17."""
    G = np.zeros((20, 17))
    G[:15, :12] = g_ins(rotation, velocity)
    G[15:, 12:] = np.eye(5)
    return G


def noise_density(
    accel: float, gyro: float, accel_walk: float, gyro_walk: float, beam_walk: float, scale_walk: float
) -> Array:
    """Spectral density of w(t) of Eq. 11, 17 × 17, from one-sigma figures per root second."""
    sd = np.concatenate(
        [
            np.full(3, accel),
            np.full(3, gyro),
            np.full(3, accel_walk),
            np.full(3, gyro_walk),
            np.full(4, beam_walk),
            [scale_walk],
        ]
    )
    return np.diag(sd**2)
