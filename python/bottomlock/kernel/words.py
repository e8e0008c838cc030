"""The kernel's classes in a line, and as a table for a notebook; `bottomlock.kernel` gives them to the classes."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.support.notebook import html_table

if TYPE_CHECKING:
    from bottomlock.kernel import BeamGeometry, Navigator

Array = NDArray[np.float64]

_PARTS = (
    ("position", "m", "position_t_m", ("north", "east", "down"), slice(0, 3)),
    ("velocity", "m/s", "velocity_p_mps", ("surge", "sway", "heave"), slice(6, 9)),
)
"""Name, unit, key of the state, axes and place of the error in the covariance."""


def _title(navigator: "Navigator") -> str:
    return f"Navigator at {navigator.state()['time_ns'] * 1e-9:.3f} s"


def _estimates(navigator: "Navigator") -> Iterator[tuple[str, str, list[tuple[str, float, float]]]]:
    """Position and velocity: name, unit, and of each axis its name, the estimate and its 1 sigma."""
    state: Any = navigator.state()
    sds = np.sqrt(np.diag(navigator.covariance()))
    for name, unit, key, axes, place in _PARTS:
        yield name, unit, list(zip(axes, state[key], sds[place], strict=True))


def navigator_line(navigator: "Navigator") -> str:
    """Time, position and velocity with their 1 sigma."""
    parts = [
        f"{name} ({', '.join(f'{value:.3g} ± {sd:.2g}' for _, value, sd in axes)}) {unit}"
        for name, unit, axes in _estimates(navigator)
    ]
    return f"<{_title(navigator)}: {', '.join(parts)}>"


def navigator_table(navigator: "Navigator") -> str:
    """Position and velocity by axis, each with its 1 sigma."""
    rows = [
        (f"{name} {axis}, {unit}", f"{value:.4g}", f"{sd:.2g}")
        for name, unit, axes in _estimates(navigator)
        for axis, value, sd in axes
    ]
    return html_table(_title(navigator), rows, ("", "estimate", "1 σ"))


def beam_angles_deg(directions_p: Array) -> tuple[Array, Array]:
    """Tilt from down and azimuth from forward to starboard, (beams,) each, of unit vectors (beams, 3).

    >>> [part.round(6).tolist() for part in beam_angles_deg(np.array([[0.0, 0.5, np.sqrt(0.75)]]))]
    [[30.0], [90.0]]
    """
    sideways = np.hypot(directions_p[:, 0], directions_p[:, 1])
    tilt = np.degrees(np.arctan2(sideways, directions_p[:, 2]))
    return tilt, np.degrees(np.arctan2(directions_p[:, 1], directions_p[:, 0]))


def geometry_line(geometry: "BeamGeometry") -> str:
    """Number of beams, their tilts and azimuths."""
    tilt, azimuth = beam_angles_deg(geometry.directions_p)
    tilts = dict.fromkeys(f"{value:.4g}" for value in tilt)
    return f"<BeamGeometry: {len(tilt)} beams, tilt {', '.join(tilts)} deg, azimuths {_listed(azimuth)} deg>"


def geometry_table(geometry: "BeamGeometry") -> str:
    """Tilt, azimuth, direction and lever arm of each beam, platform axes."""
    directions, levers = geometry.directions_p, geometry.lever_arms_p_m
    rows = [
        (str(k + 1), f"{tilt:.4g}", f"{azimuth:.4g}", _listed(directions[k]), _listed(levers[k]))
        for k, (tilt, azimuth) in enumerate(zip(*beam_angles_deg(directions), strict=True))
    ]
    return html_table(
        "BeamGeometry", rows, ("beam", "tilt, deg", "azimuth, deg", "direction", "lever arm, m")
    )


def _listed(numbers: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in numbers)
