"""The kernel's classes in a line, and as a table for a notebook; `bottomlock.kernel` gives them to the classes."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.text import html_table

if TYPE_CHECKING:
    from bottomlock.kernel import BeamGeometry, Navigator

Array = NDArray[np.float64]


def _title(navigator: "Navigator") -> str:
    return f"Navigator at {navigator.state()['time_ns'] * 1e-9:.3f} s"


def _estimates(navigator: "Navigator") -> dict[tuple[str, str], list[tuple[str, float, float]]]:
    """By quantity and unit: each axis with the estimate and its 1 sigma."""
    state: Any = navigator.state()
    sds = np.sqrt(np.diag(navigator.covariance()))
    position = zip(("north", "east", "down"), state["position_t_m"], sds[0:3], strict=True)
    velocity = zip(("surge", "sway", "heave"), state["velocity_p_mps"], sds[6:9], strict=True)
    return {("position", "m"): list(position), ("velocity", "m/s"): list(velocity)}


def navigator_line(navigator: "Navigator") -> str:
    """Time, position and velocity with their 1 sigma."""
    parts = [
        f"{name} ({', '.join(f'{value:.3g} ± {sd:.2g}' for _, value, sd in axes)}) {unit}"
        for (name, unit), axes in _estimates(navigator).items()
    ]
    return f"<{_title(navigator)}: {', '.join(parts)}>"


def navigator_table(navigator: "Navigator") -> str:
    """Position and velocity by axis, each with its 1 sigma."""
    rows = [
        (f"{name} {axis}, {unit}", f"{value:.4g}", f"{sd:.2g}")
        for (name, unit), axes in _estimates(navigator).items()
        for axis, value, sd in axes
    ]
    return html_table(_title(navigator), rows, ("", "estimate", "1 σ"))


def _beams(geometry: "BeamGeometry") -> list[tuple[str, ...]]:
    """Of each beam: its number, tilt from down and azimuth from forward to starboard (deg), direction, lever arm."""
    x, y, z = geometry.directions_p.T
    tilts, azimuths = np.degrees(np.arctan2(np.hypot(x, y), z)), np.degrees(np.arctan2(y, x))
    numbers = zip(
        tilts[:, None], azimuths[:, None], geometry.directions_p, geometry.lever_arms_p_m, strict=True
    )
    return [(str(k), *map(_listed, of)) for k, of in enumerate(numbers, start=1)]


def geometry_line(geometry: "BeamGeometry") -> str:
    """Number of beams, their tilts and azimuths."""
    _, tilts, azimuths, *_ = zip(*_beams(geometry), strict=True)
    tilt = ", ".join(dict.fromkeys(tilts))
    return f"<BeamGeometry: {len(tilts)} beams, tilt {tilt} deg, azimuths {', '.join(azimuths)} deg>"


def geometry_table(geometry: "BeamGeometry") -> str:
    """Tilt, azimuth, direction and lever arm of each beam, platform axes."""
    head = ("beam", "tilt, deg", "azimuth, deg", "direction", "lever arm, m")
    return html_table("BeamGeometry", _beams(geometry), head)


def _listed(numbers: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in numbers)
