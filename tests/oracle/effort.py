"""Forces of thrusters as their equation stands, its derivatives by central differences.

The states are the 20 of the error state, then of surge, sway and heave each the speed a over that by the drag law, the
slip s and the relative error of mass m, and the current, north and east.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.oracle.rotations import Array, exp_rotation

STATES = 31
MISALIGNMENT, VELOCITY, ACCEL_BIAS, GYRO_BIAS = slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15)
SCALE, SLIP, INERTIA, CURRENT = slice(20, 23), slice(23, 26), slice(26, 29), slice(29, 31)


@dataclass(frozen=True)
class Hull:
    """Mass and added mass, kg; linear and quadratic drag; buoyancy less weight, N; where they refer to, m."""

    mass: Array
    linear: Array
    quadratic: Array
    buoyancy: float
    lever: Array


def speed(linear: float, quadratic: float, force: float) -> float:
    """The positive root of q n² + d n = |F|, with the sign of the force."""
    roots = np.roots([quadratic, linear, -abs(force)]) if quadratic else np.array([abs(force) / linear])
    return float(np.sign(force) * np.max(roots.real))


def residual(
    hull: Hull, force: Array, attitude_t_p: Array, velocity_p: Array, rate: Array, change: Array, own: Array
) -> Array:
    """Of each axis a n + s - u; `own` are the states from `SCALE` on, `change` the acceleration (no angular one)."""
    scale, slip, inertia, current = own[:3], own[3:6], own[6:9], np.append(own[9:11], 0.0)
    current_p = attitude_t_p.T @ current
    u = velocity_p + np.cross(rate, hull.lever) - current_p
    down_p = attitude_t_p.T @ [0.0, 0.0, 1.0]
    taken = hull.mass * (1.0 + inertia) * (change + np.cross(rate, current_p)) + np.cross(rate, hull.mass * u)
    left = force - hull.buoyancy * down_p - taken
    n = [speed(*law) for law in zip(hull.linear, hull.quadratic, left, strict=True)]
    return np.asarray(scale * n + slip - u)


def acceleration(
    attitude_t_p: Array, velocity_p: Array, rate: Array, force_p: Array, gravity: float
) -> Array:
    """Of the velocity's components in platform axes, over a plane that does not turn."""
    return np.asarray(force_p + attitude_t_p.T @ [0.0, 0.0, gravity] - np.cross(rate, velocity_p))


def jacobian(
    hull: Hull,
    force: Array,
    attitude_t_p: Array,
    velocity_p: Array,
    rate: Array,
    force_p: Array,
    own: Array,
    gravity: float,
) -> Array:
    """H (3, 31) of z = H dx, by central differences; the error of the mean acceleration is that of the state's."""

    def moved(error: Array) -> Array:
        R = exp_rotation(error[MISALIGNMENT]) @ attitude_t_p
        v, w = velocity_p + error[VELOCITY], rate - error[GYRO_BIAS]
        f = force_p - error[ACCEL_BIAS]
        yaw = exp_rotation(np.array([0.0, 0.0, error[5]]))[:2, :2]
        states = own + error[20:]
        states[9:11] = yaw @ own[9:11] + error[CURRENT]
        before = acceleration(attitude_t_p, velocity_p, rate, force_p, gravity)
        return residual(hull, force, R, v, w, acceleration(R, v, w, f, gravity) - before, states)

    return -_differences(moved)


def _differences(function: Callable[[Array], Array], step: float = 1e-6) -> Array:
    columns = [(function(step * e) - function(-step * e)) / (2.0 * step) for e in np.eye(STATES)]
    return np.stack(columns, axis=1)
