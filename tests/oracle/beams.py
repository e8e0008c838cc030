"""Tal et al. 2017, Eqs. 13-17 and 19-22: beams and velocity of a DVL with all its beams, one line an equation.

Platform frame, m/s, rad. Arrays of beams hold beam 1 in row 0.
"""

import numpy as np

from tests.oracle.rotations import Array, skew

TILT_RAD = np.deg2rad(20.0)


def direction(tilt_rad: float, azimuth_rad: float) -> Array:
    """Unit vector of a beam, Eq. 13; the first angle is the tilt from the vertical (erratum E9)."""
    return np.array(
        [np.cos(azimuth_rad) * np.sin(tilt_rad), np.sin(azimuth_rad) * np.sin(tilt_rad), np.cos(tilt_rad)]
    )


def azimuth_rad(beam: int) -> float:
    """Azimuth of beam 1..4 of the x-Janus, Eq. 14."""
    return float(np.deg2rad((beam - 1) * 90.0 + 45.0))


def x_janus(tilt_rad: float = TILT_RAD) -> Array:
    """The matrix A of Eq. 16, shape (4, 3)."""
    return np.array([direction(tilt_rad, azimuth_rad(beam)) for beam in (1, 2, 3, 4)])


def beam_velocity(
    b: Array, velocity: Array, rate: Array, lever: Array, bias: float = 0.0, scale_factor: float = 0.0
) -> float:
    """Noise-free reading of one beam, Eq. 15, with the dot product that erratum E6 puts for the cross."""
    at_transducer = velocity * (1 + scale_factor) + np.cross(rate, lever)
    return float(b @ at_transducer + bias)


def velocity_weighted(A: Array, y: Array, R: Array) -> Array:
    """Eq. 17 with the weights of Eq. 19: (AᵀWA)⁻¹ AᵀW y, W = R⁻¹."""
    W = np.linalg.inv(R)
    return np.linalg.inv(A.T @ W @ A) @ A.T @ W @ y


def velocity_covariance(A: Array, R: Array) -> Array:
    """R_vel of Eq. 19."""
    return np.linalg.inv(A.T @ np.linalg.inv(R) @ A)


def beam_noise(A: Array, levers: Array, gyro_sd: float, sd: Array) -> Array:
    """Eq. 20: lever arms let the noise of one gyro triad into every beam, so the matrix is full.

    Printed with b_i on both sides only, which gives the diagonal; element (i, j) pairs b_i with b_j.
    """
    rows = np.array([b @ skew(lever) for b, lever in zip(A, levers, strict=True)])
    noise: Array = gyro_sd**2 * rows @ rows.T + np.diag(sd**2)
    return noise


def h_tight(A: Array, velocity: Array, levers: Array, scale_factor: float) -> Array:
    """Eq. 22, m × 20, row i with its own lever arm: b_iᵀ [l_i×] multiplies the gyro bias (erratum E7)."""
    H = np.zeros((len(A), 20))
    for i, (b, lever) in enumerate(zip(A, levers, strict=True)):
        H[i, 6:9] = b * (1 + scale_factor)
        H[i, 12:15] = b @ skew(lever)
        H[i, 15 + i] = 1.0
        H[i, 19] = b @ velocity
    return H
