"""The kernel's classes in a line, and as a table for a notebook; `bottomlock.kernel` gives them to the classes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.support.notebook import html_table

Array = NDArray[np.float64]

_PARTS = (
    ("position", "m", "position_t_m", ("north", "east", "down"), slice(0, 3)),
    ("velocity", "m/s", "velocity_p_mps", ("surge", "sway", "heave"), slice(6, 9)),
)
"""Name, unit, key of the state, axes and place of the error in the covariance."""


def navigator_line(state: Mapping[str, Any], covariance: Array) -> str:
    """Time, position and velocity with their 1 sigma.

    Args:
        state: as `Navigator.state` returns it.
        covariance: (n, n) as `Navigator.covariance` returns it.
    """
    parts = []
    for name, unit, key, _, place in _PARTS:
        pairs = zip(state[key], np.sqrt(np.diag(covariance)[place]), strict=True)
        parts.append(f"{name} ({', '.join(f'{value:.3g} ± {sd:.2g}' for value, sd in pairs)}) {unit}")
    return f"<Navigator at {state['time_ns'] * 1e-9:.3f} s: {', '.join(parts)}>"


def navigator_table(state: Mapping[str, Any], covariance: Array) -> str:
    """Position and velocity by axis, each with its 1 sigma; arguments as `navigator_line`."""
    rows = []
    for name, unit, key, axes, place in _PARTS:
        sds = np.sqrt(np.diag(covariance)[place])
        rows += [
            (f"{name} {axis}, {unit}", f"{value:.4g}", f"{sd:.2g}")
            for axis, value, sd in zip(axes, state[key], sds, strict=True)
        ]
    return html_table(f"Navigator at {state['time_ns'] * 1e-9:.3f} s", rows, ("", "estimate", "1 σ"))


def beam_angles_deg(directions_p: Array) -> tuple[Array, Array]:
    """Tilt from down and azimuth from forward to starboard, (beams,) each, of unit vectors (beams, 3).

    >>> [part.round(6).tolist() for part in beam_angles_deg(np.array([[0.0, 0.5, np.sqrt(0.75)]]))]
    [[30.0], [90.0]]
    """
    sideways = np.hypot(directions_p[:, 0], directions_p[:, 1])
    tilt = np.degrees(np.arctan2(sideways, directions_p[:, 2]))
    return tilt, np.degrees(np.arctan2(directions_p[:, 1], directions_p[:, 0]))


def geometry_line(directions_p: Array) -> str:
    """Number of beams, their tilts and azimuths."""
    tilt, azimuth = beam_angles_deg(directions_p)
    tilts = dict.fromkeys(f"{value:.4g}" for value in tilt)
    azimuths = ", ".join(f"{value:.4g}" for value in azimuth)
    return f"<BeamGeometry: {len(tilt)} beams, tilt {', '.join(tilts)} deg, azimuths {azimuths} deg>"


def geometry_table(directions_p: Array, lever_arms_p_m: Array) -> str:
    """Tilt, azimuth, direction and lever arm of each beam, platform axes."""
    rows = [
        (str(k + 1), f"{tilt:.4g}", f"{azimuth:.4g}", _three(directions_p[k]), _three(lever_arms_p_m[k]))
        for k, (tilt, azimuth) in enumerate(zip(*beam_angles_deg(directions_p), strict=True))
    ]
    return html_table(
        "BeamGeometry", rows, ("beam", "tilt, deg", "azimuth, deg", "direction", "lever arm, m")
    )


def _three(vector: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in vector)
