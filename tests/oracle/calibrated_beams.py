"""Readings of a DVL whose mounting and clock are off, literally: another rotation, and the motion at another time."""

import numpy as np

from tests.oracle.rotations import Array, exp_rotation


def readings(
    directions_p: Array,
    lever_p_m: Array,
    velocity_p_mps: Array,
    omega_tp_p_radps: Array,
    *,
    mounting_rad: Array | None = None,
    scale: float | Array = 0.0,
) -> Array:
    """Beam velocities (n, B), m/s, without noise: b · [(1 + SF) v + ω × l] (Eq. 15).

    Args:
        directions_p: (B, 3) as stated.
        lever_p_m: (3,) of the instrument.
        velocity_p_mps, omega_tp_p_radps: (n, 3) at the times at which the readings were taken.
        mounting_rad: (3,) rotation vector from the stated mounting to the true one, platform axes.
        scale: the scale factor, one or (n,).
    """
    turn = np.eye(3) if mounting_rad is None else exp_rotation(mounting_rad)
    out = np.empty((len(velocity_p_mps), len(directions_p)))
    factor = 1 + np.broadcast_to(scale, len(velocity_p_mps))
    for i, (v, omega) in enumerate(zip(velocity_p_mps, omega_tp_p_radps, strict=True)):
        for j, b in enumerate(directions_p):
            out[i, j] = (turn @ b) @ (factor[i] * v + np.cross(omega, lever_p_m))
    return out
