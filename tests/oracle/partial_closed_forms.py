"""Tal et al. 2017, Eqs. 23-47, for beams 1 and 2 left of an x-Janus: each method as the paper writes it.

`..._as_printed` holds what the paper prints where that is wrong; `..._corrected` the right form (docs/equations.md,
errata E1-E6 and E13). A function without either suffix is right as printed. b[i, j] is the paper's b_{i+1,j+1}.
"""

import numpy as np

from tests.oracle.rotations import Array

# --- Virtual beam, Sect. 3.1 -------------------------------------------------------------------------------------


def third_beam(b: Array, prior: Array) -> float:
    """Eq. 24: beam 3 as the last velocity predicts it."""
    return float(b[2] @ prior)


def virtual_beam_velocity(b: Array, y1: float, y2: float, prior: Array) -> Array:
    """Eq. 25 with A_s of Eq. 23 (printed A, which has four rows; erratum E6)."""
    A_s = b[:3]
    velocity: Array = np.linalg.inv(A_s) @ np.array([y1, y2, third_beam(b, prior)])
    return velocity


def third_beam_sd_as_printed(b: Array, prior_cov: Array, n_f: float) -> float:
    """Eqs. 27 and 28: only the diagonal of the prior covariance."""
    sd_u, sd_v, sd_w = np.sqrt(np.diag(prior_cov))
    return float(n_f * np.sqrt((b[2, 0] * sd_u) ** 2 + (b[2, 1] * sd_v) ** 2 + (b[2, 2] * sd_w) ** 2))


def third_beam_sd_corrected(b: Array, prior_cov: Array, n_f: float) -> float:
    """Eq. 28 with the off-diagonal terms (erratum E6): n_f √(b₃ᵀ P b₃)."""
    return float(n_f * np.sqrt(b[2] @ prior_cov @ b[2]))


def virtual_beam_covariance(b: Array, sd1: float, sd2: float, sd3: float) -> Array:
    """Eqs. 29 and 30."""
    A_s = b[:3]
    W_s = np.linalg.inv(np.diag([sd1**2, sd2**2, sd3**2]))
    return np.linalg.inv(A_s.T @ W_s @ A_s)


def virtual_beam_covariance_by_propagation(b: Array, sd1: float, sd2: float, sd3: float) -> Array:
    """Eq. 30 for its square A_s, A_s⁻¹ R A_s⁻ᵀ: the same matrix without inverting a near-singular AᵀWA.

    Inverted as printed in double precision Eq. 30 loses up to 6e-12 of it, more than the product does (4e-16).
    """
    inverse = np.linalg.inv(b[:3])
    covariance: Array = inverse @ np.diag([sd1**2, sd2**2, sd3**2]) @ inverse.T
    return covariance


# --- Nullified sway, Sect. 3.2 -----------------------------------------------------------------------------------


def a_zero(b: Array, first: int = 1, second: int = 2) -> Array:
    """Eq. 31: surge and heave columns of two beams, numbered from 1."""
    return np.array([[b[first - 1, 0], b[first - 1, 2]], [b[second - 1, 0], b[second - 1, 2]]])


def nullified_sway_velocity(b: Array, y1: float, y2: float) -> Array:
    """Eq. 33, with the zero sway put in."""
    u, w = np.linalg.inv(a_zero(b)) @ np.array([y1, y2])
    return np.array([u, 0.0, w])


def nullified_sway_r0(b: Array, sd1: float, sd2: float) -> Array:
    """Eqs. 34 and 35 (A_zero of the print is A₀; erratum E6)."""
    W_0 = np.linalg.inv(np.diag([sd1**2, sd2**2]))
    A_0 = a_zero(b)
    return np.linalg.inv(A_0.T @ W_0 @ A_0)


def nullified_sway_covariance_as_printed(b: Array, sd1: float, sd2: float, epsilon: float) -> Array:
    """Eq. 36: diagonal, and the error that a sway of variance ε makes in surge and heave is left out (erratum E13)."""
    R_0 = nullified_sway_r0(b, sd1, sd2)
    return np.diag([R_0[0, 0], epsilon, R_0[1, 1]])


def nullified_sway_covariance_corrected(b: Array, sd1: float, sd2: float, epsilon: float) -> Array:
    """Eq. 36 by propagation of the errors of Eq. 33 when the true sway has variance ε.

    (u, w) = A₀⁻¹ (y − b_y v): R₀ plus ε times the outer product of A₀⁻¹ b_y, and the cross terms.
    """
    leak = np.linalg.inv(a_zero(b)) @ b[:2, 1]
    R_0 = nullified_sway_r0(b, sd1, sd2)
    through = np.array([-leak[0], 1.0, -leak[1]])
    full = epsilon * np.outer(through, through)
    full[np.ix_([0, 2], [0, 2])] += R_0
    return full


# --- Partial loose coupling, Sect. 3.3 ---------------------------------------------------------------------------


def partial_loose_surge(b: Array, y1: float, y2: float) -> float:
    """Eq. 40 (called sway in the print; erratum E6)."""
    return float((y1 - y2) / (2 * b[0, 0]))


def partial_loose_surge_variance(b: Array, sd1: float, sd2: float) -> float:
    """Eq. 41."""
    return float((sd1**2 + sd2**2) / (4 * b[0, 0] ** 2))


# --- Virtual heave, Sect. 3.4 ------------------------------------------------------------------------------------


def virtual_heave_sway(b: Array, y1: float, y2: float, prior_heave: float) -> float:
    """Eq. 45."""
    return float((y1 + y2) / (2 * b[0, 1]) - b[0, 2] / b[0, 1] * prior_heave)


def virtual_heave_sway_variance_as_printed(b: Array, sd1: float, sd2: float, heave_sd: float) -> float:
    """Eq. 46 with its minus sign: negative as soon as the heave is poorly known (erratum E1)."""
    return float((sd1**2 + sd2**2) / (4 * b[0, 1] ** 2) - (b[0, 2] / b[0, 1]) ** 2 * heave_sd**2)


def virtual_heave_sway_variance_corrected(b: Array, sd1: float, sd2: float, heave_sd: float) -> float:
    """Eq. 46 with the plus sign that propagation of Eq. 45 gives (erratum E1)."""
    return float((sd1**2 + sd2**2) / (4 * b[0, 1] ** 2) + (b[0, 2] / b[0, 1]) ** 2 * heave_sd**2)


def virtual_heave_covariance_as_printed(b: Array, sd1: float, sd2: float, heave_sd: float) -> Array:
    """Eq. 47: diagonal; heave is not reported, so its variance is infinite."""
    surge = partial_loose_surge_variance(b, sd1, sd2)
    sway = virtual_heave_sway_variance_as_printed(b, sd1, sd2, heave_sd)
    return np.diag([surge, sway, np.inf])


def virtual_heave_cross_covariance(b: Array, sd1: float, sd2: float) -> float:
    """Covariance of surge and sway, from Eqs. 40 and 45; zero for equal beams, left out of Eq. 47."""
    return float((sd1**2 - sd2**2) / (4 * b[0, 0] * b[0, 1]))
