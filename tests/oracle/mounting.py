"""What a DVL reads that sits turned and away from the reference point; by matrices written out."""

import numpy as np

from tests.oracle.rotations import Array


def turn(roll: float, pitch: float, yaw: float) -> Array:
    """(3, 3) Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(z @ y @ x)


def angles(t: float, lively: float) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a vehicle that weaves; `lively` 0 keeps it straight and level."""
    return (
        lively * 0.15 * np.sin(0.5 * t),
        lively * 0.12 * np.sin(0.37 * t + 1.0),
        lively * (0.9 * np.sin(0.11 * t) + 0.3 * np.sin(0.43 * t)),
    )


def surge_sway_heave(t: float, lively: float) -> Array:
    """Velocity in the platform frame."""
    return np.array(
        [
            1.2 + lively * 0.5 * np.sin(0.21 * t),
            lively * 0.3 * np.sin(0.33 * t),
            lively * 0.2 * np.sin(0.27 * t + 2.0),
        ]
    )


def rate(t: float, lively: float) -> Array:
    """Rate of the platform in its own axes, from the attitudes a millisecond apart."""
    h = 5e-4
    before, after = turn(*angles(t - h, lively)), turn(*angles(t + h, lively))
    S = (turn(*angles(t, lively)).T @ (after - before)) / (2 * h)
    return np.array([S[2, 1], S[0, 2], S[1, 0]])


def dvl_reads(t: float, lively: float, *, mounted: Array, arm: Array, scale: float) -> Array:
    """(1 + s) R_pdᵀ (v + ω × l)."""
    w = rate(t, lively)
    across = np.array(
        [w[1] * arm[2] - w[2] * arm[1], w[2] * arm[0] - w[0] * arm[2], w[0] * arm[1] - w[1] * arm[0]]
    )
    return np.asarray((1.0 + scale) * mounted.T @ (surge_sway_heave(t, lively) + across))
