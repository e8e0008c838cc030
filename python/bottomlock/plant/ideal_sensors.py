"""Readings of ideal inertial sensors along a state history, from the same derivatives that integrated it."""

import numpy as np

from bottomlock.plant.equations import to_platform
from bottomlock.plant.maths import FloatArray


def inertial_measurements(
    state: FloatArray,
    acceleration: FloatArray,
    *,
    latitude_rad: float,
    gravity_mps2: float,
    earth_rate_radps: float,
) -> tuple[FloatArray, FloatArray]:
    """Inertial rate w_ip (rad/s) and specific force (m/s²), both (N, 3), platform frame.

    The mechanisation v' = f + R' g - (w_ip + R' w_ie) x v solved for f, with v' of the equations of motion;
    w_ip = w_tp + R' w_ie.
    """
    q0, q1, q2, q3 = state[:, 3:7].T
    north = np.full_like(q0, earth_rate_radps * np.cos(latitude_rad))
    down = np.full_like(q0, -earth_rate_radps * np.sin(latitude_rad))
    level = np.zeros_like(q0)
    earth_p = np.stack(to_platform(q0, q1, q2, q3, north, level, down), axis=1)
    gravity_p = np.stack(to_platform(q0, q1, q2, q3, level, level, level + gravity_mps2), axis=1)
    omega = state[:, 10:13] + earth_p
    force = acceleration[:, :3] - gravity_p + np.cross(omega + earth_p, state[:, 7:10])
    return omega, force
