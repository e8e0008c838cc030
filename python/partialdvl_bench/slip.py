"""Sway through the water that a simulated vehicle does not have of itself, added to its true motion."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from bottomlock import Truth

KNOT_S = 0.2
"""A slip is drawn at these times and is a cubic spline between them, so that its acceleration is continuous."""


def drawn_slip(draw: np.random.Generator, *, sd_mps: float, time_s: float, duration_s: float) -> CubicSpline:
    """A first-order process of this standard deviation and correlation time, stationary from the start on."""
    t = np.arange(0.0, duration_s + 2.0 * KNOT_S, KNOT_S)
    kept = np.exp(-KNOT_S / time_s)
    slip = sd_mps * draw.standard_normal(len(t))
    for k in range(1, len(t)):
        slip[k] = kept * slip[k - 1] + np.sqrt(1.0 - kept**2) * slip[k]
    return CubicSpline(t, slip)


def slipping(truth: Truth, slip: CubicSpline, earth_rate_radps: float) -> Truth:
    """The motion of a vehicle that has this sway besides its own, over a plane Earth; its attitude is as before.

    v̇ = f + Rᵀg − (ω_ip + Rᵀω_ie) × v in platform axes, so that a sway s adds ṡ e_y + (ω_ip + Rᵀω_ie) × s e_y to f.
    """
    t: NDArray[np.float64] = (truth.time_ns - truth.time_ns[0]) * 1e-9
    aside = np.array([0.0, 1.0, 0.0])
    sway, rate = slip(t)[:, None] * aside, slip(t, 1)[:, None] * aside
    attitude = Rotation.from_quat(truth.attitude_t_p, scalar_first=True)
    earth_t = earth_rate_radps * np.array([np.cos(truth.latitude_rad), 0.0, -np.sin(truth.latitude_rad)])
    turning = truth.omega_p_radps + attitude.apply(earth_t, inverse=True)
    return replace(
        truth,
        position_t_m=truth.position_t_m + cumulative_simpson(attitude.apply(sway), x=t, axis=0, initial=0.0),
        velocity_p_mps=truth.velocity_p_mps + sway,
        force_p_mps2=truth.force_p_mps2 + rate + np.cross(turning, sway),
    )
