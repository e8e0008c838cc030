"""Truths from analytic angles: body rates and specific force by differentiating the motion, positions by quadrature.

Platform velocity is constant (surge alone); yaw and pitch are given functions of time with their derivatives.
"""

from collections.abc import Callable

import numpy as np
from scipy.integrate import cumulative_simpson

from tests.oracle.mechanisation import earth_rate_tangent
from tests.oracle.rotations import Array, matrix_from_euler, quaternion_from_euler

Angle = Callable[[Array], tuple[Array, Array]]


def zero(t: Array) -> tuple[Array, Array]:
    """No angle, no rate."""
    return np.zeros_like(t), np.zeros_like(t)


def figure_eight_yaw(t: Array) -> tuple[Array, Array]:
    """Yaw swings ±2.4 rad (close to the 2.405 that shuts the eight) with a period of 125 s."""
    w = 2 * np.pi / 125
    return 2.4 * np.cos(w * t) - 2.4, -2.4 * w * np.sin(w * t)


def dive_pitch(t: Array) -> tuple[Array, Array]:
    """Bow down to 10° and level again within the first 60 s, smooth at both ends."""
    w = 2 * np.pi / 60
    inside = t < 60
    depth = np.deg2rad(10) / 2
    return np.where(inside, -depth * (1 - np.cos(w * t)), 0), np.where(inside, -depth * w * np.sin(w * t), 0)


def make(
    yaw: Angle = zero,
    pitch: Angle = zero,
    *,
    surge_mps: float = 2.0,
    seconds: float = 250.0,
    rate_hz: float = 150.0,
    gravity: float = 9.8,
    latitude_rad: float = 0.5725,
) -> dict[str, Array]:
    """The arrays of a truth: Earth rate and gravity included in what ideal sensors read."""
    time_ns = np.round(np.arange(int(seconds * rate_hz) + 1) * 1e9 / rate_hz).astype(np.int64)
    t = time_ns * 1e-9
    psi, psi_rate = yaw(t)
    theta, theta_rate = pitch(t)
    earth = earth_rate_tangent(latitude_rad)
    n = len(t)
    quaternion, omega, force, velocity_t = (
        np.empty((n, 4)),
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty((n, 3)),
    )
    v = np.array([surge_mps, 0.0, 0.0])
    for k in range(n):
        R = matrix_from_euler(0.0, theta[k], psi[k])
        # Euler rates at zero roll: yaw rate about tangent z, pitch rate about platform y.
        rate_tp = R.T @ np.array([0, 0, psi_rate[k]]) + np.array([0, theta_rate[k], 0])
        earth_p = R.T @ earth
        quaternion[k] = quaternion_from_euler(0.0, theta[k], psi[k])
        omega[k] = rate_tp + earth_p
        # v̇ = 0 = f + Rᵀg − (ω_ip + Rᵀω_ie) × v.
        a, g_p = omega[k] + earth_p, R.T @ np.array([0, 0, gravity])
        force[k] = np.array([0.0, a[2] * surge_mps, -a[1] * surge_mps]) - g_p
        velocity_t[k] = R @ v
    position = cumulative_simpson(velocity_t, x=t, axis=0, initial=0)
    return {
        "time_ns": time_ns,
        "position_t_m": position,
        "attitude_t_p": quaternion,
        "velocity_p_mps": np.tile(v, (n, 1)),
        "omega_p_radps": omega,
        "force_p_mps2": force,
    }
