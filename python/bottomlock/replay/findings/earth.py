"""Where a track leaves what the models of the Earth hold for: near a pole, very high or deep, or a tangent plane."""

import numpy as np
import polars as pl

from bottomlock.kernel import local_earth
from bottomlock.kernel.models import Environment
from bottomlock.recordings.finding import Finding

NEAREST_POLE_DEG = 0.1
"""Nearer to a pole north turns by a degree in 200 m and less."""
HIGHEST_M = 10_000.0
DEEPEST_M = 11_500.0
"""Heights above and depths below the ellipsoid for which latitude (1e-11 rad) and gravity are checked."""
PLANE_M = 0.3
"""Depth by which the level may leave a tangent plane unremarked: 2 km from the origin."""
_RADIUS_M = 6_371_000.0


def earth_findings(environment: Environment, samples: pl.DataFrame) -> list[Finding]:
    """Places near a pole, beyond the heights of the model, and far from the origin of a tangent plane.

    Args:
        environment: of the replay's model.
        samples: `files.replay_tables.REPLAY_SAMPLES`, whose positions count.
    """
    position = samples.select("north_m", "east_m", "down_m").drop_nulls().to_numpy()
    position = position[np.isfinite(position).all(axis=1)]
    if not len(position):
        return []
    if environment.earth == "tangent_plane":
        return _plane(position)
    from_pole = np.abs(np.pi / 2.0 - abs(environment.latitude_rad)) * _RADIUS_M
    towards = position[:, 0] * np.sign(environment.latitude_rad)
    nearest_deg = float(np.rad2deg(np.hypot(from_pole - towards, position[:, 1]).min() / _RADIUS_M))
    depth = local_earth(environment, position)["depth_m"]
    found = []
    if nearest_deg < NEAREST_POLE_DEG:
        found.append(
            Finding(
                "near_pole", "warning", NEAREST_POLE_DEG / max(nearest_deg, 1e-6),
                f"The track comes within {nearest_deg:.3f} deg of a pole, where north has no meaning.",
                f"Headings are from north at the vehicle and hold to within {NEAREST_POLE_DEG:g} deg of the pole; "
                "position, velocity, level and gravity hold there too.",
                "Do not aid by headings there (attitude.aids, heading), and read positions, not yaw.", "origin.earth",
            )
        )  # fmt: skip
    if float(depth.max()) > DEEPEST_M or float(-depth.min()) > HIGHEST_M:
        found.append(
            Finding(
                "height_limits", "warning", 1.0,
                f"The track lies between {depth.min():.0f} and {depth.max():.0f} m below the ellipsoid.",
                f"Latitude and gravity of the model hold from {HIGHEST_M:.0f} m above to {DEEPEST_M:.0f} m below it.",
                "Check the height of the origin and the unit of depths and heights.", "origin.height_m",
            )
        )  # fmt: skip
    return found


def _plane(position: np.ndarray) -> list[Finding]:
    distance_m = float(np.hypot(position[:, 0], position[:, 1]).max())
    below_m = distance_m**2 / (2.0 * _RADIUS_M)
    if below_m < PLANE_M:
        return []
    return [
        Finding(
            "tangent_plane", "warning", (below_m / PLANE_M) ** 2,
            f"The track goes {distance_m / 1000:.1f} km from the origin of a tangent plane, which leaves the level of "
            f"the sea by {below_m:.1f} m there.",
            f"Level and gravity are off by {np.rad2deg(distance_m / _RADIUS_M):.3f} deg, depths by as many metres.",
            'Navigate on the ellipsoid: origin.earth = "ellipsoid", the default.', "origin.earth",
        )
    ]  # fmt: skip
