"""The mechanisation as an ordinary differential equation, integrated by an eighth-order method with tight tolerances.

ṙ = R v;  Ṙ = R [ω_tp×], ω_tp = ω_ip − Rᵀ ω_ie;  v̇ = f + Rᵀ g − (ω_ip + Rᵀ ω_ie) × v.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from tests.oracle.rotations import Array, matrix_from_quaternion, quaternion_product

EARTH_RATE = 7.292115e-5

Signal = Callable[[float], Array]


@dataclass(frozen=True)
class Motion:
    """States at the asked times: position (T, 3), quaternion (T, 4), platform velocity (T, 3)."""

    position: Array
    quaternion: Array
    velocity: Array


def earth_rate_tangent(latitude_rad: float, rate: float = EARTH_RATE) -> Array:
    """Earth rate in north, east, down."""
    return rate * np.array([np.cos(latitude_rad), 0.0, -np.sin(latitude_rad)])


def integrate(
    start: tuple[Array, Array, Array],
    rate_ip: Signal,
    force: Signal,
    gravity: float,
    earth_rate_t: Array,
    times_s: Array,
) -> Motion:
    """Integrates from `start` = (position, quaternion w-first, velocity) at times_s[0] to each of times_s."""
    gravity_t = np.array([0.0, 0.0, gravity])

    def derivative(t: float, x: Array) -> Array:
        q, v = x[3:7] / np.linalg.norm(x[3:7]), x[7:10]
        rotation = matrix_from_quaternion(q)
        earth_rate_p = rotation.T @ earth_rate_t
        w, f = rate_ip(t), force(t)
        q_dot = quaternion_product(q, np.concatenate([[0.0], w - earth_rate_p])) / 2
        v_dot = f + rotation.T @ gravity_t - np.cross(w + earth_rate_p, v)
        return np.concatenate([rotation @ v, q_dot, v_dot])

    solution = solve_ivp(
        derivative,
        (times_s[0], times_s[-1]),
        np.concatenate(start),
        method="DOP853",
        t_eval=times_s,
        rtol=1e-12,
        atol=1e-12,
    )
    if not solution.success:
        raise ArithmeticError(solution.message)
    x = solution.y.T
    return Motion(x[:, :3], x[:, 3:7] / np.linalg.norm(x[:, 3:7], axis=1, keepdims=True), x[:, 7:])
