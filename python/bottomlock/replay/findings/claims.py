"""Errors against the reference beyond what the filter claims, and places beyond the model of the Earth."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.kernel import local_earth
from bottomlock.kernel.models import Environment
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.verdict import HIGH_RATIO, PREFERRED, PROBABILITY
from bottomlock.statistics.robust import correlation_rows
from bottomlock.tables.replay import FORWARD

_COMPONENTS = {
    "position": ("position", ("north_m", "east_m", "down_m")),
    "velocity": ("velocity", ("surge_mps", "sway_mps", "heave_mps")),
    "attitude": ("misalignment", ("north_rad", "east_rad", "down_rad")),
}
_ADVICE = {
    "position": "Check reference.lever_arm_m, the origin, dvl.errors.scale_factor_percent and start.position_sd_m.",
    "velocity": "Check reference.clock, reference.lever_arm_m, dvl.beam_noise_mps and dvl.errors.",
    "attitude": "Check reference.clock, mounting, start.heading_sd_deg, start.level_sd_deg and imu.errors.",
}
KNOWN = 10.0
"""Correlation times in a series from which on the time is known; a series with fewer is worth one value."""
FEWEST = 10
"""Samples from which on a claim is judged."""


def claims_findings(samples: pl.DataFrame, methods: Sequence[str]) -> list[Finding]:
    """Position, velocity and attitude whose errors over claimed σ are far beyond chi-squared.

    Errors last: a series is worth as many values as it has correlation times, at least one an axis. The first sample is
    the start itself, whose deviations are given.

    Args:
        samples: `tables.replay.REPLAY_SAMPLES` of the recording.
        methods: of the case.
    """
    used = [m for m in (*PREFERRED, *methods) if m in methods and m != "ins"]
    if not used:
        return []
    rows = samples.filter((pl.col("pass") == FORWARD) & (pl.col("method") == used[0])).slice(1)
    found = []
    for quantity, (what, ends) in _COMPONENTS.items():
        ratios = [
            (rows[f"err_{what}_{end}"] / rows[f"sd_{what}_{end}"]).drop_nulls().to_numpy() for end in ends
        ]
        # A reference without a height has no error of down.
        ratios = [one[np.isfinite(one)] for one in ratios if len(one)]
        if not ratios:
            continue
        if min(len(one) for one in ratios) < FEWEST:
            continue
        squares = np.array([float(np.mean(one**2)) for one in ratios])
        worth = np.array([_worth(one) for one in ratios])
        mean = float(squares @ worth / worth.sum())
        if chi2.sf(squares @ worth, worth.sum()) > 1.0 - PROBABILITY or mean < HIGH_RATIO:
            continue
        most = float(np.sqrt(chi2.ppf(PROBABILITY, worth.sum()) / worth.sum()))
        worst = int(np.argmax(squares))
        found.append(
            Finding(
                "claims", "warning", float(mean * worth.sum()),
                f"The error of {quantity} is {np.sqrt(mean):.1f} times the claimed 1 sigma.",
                f"Method {used[0]}, RMS over time and axes against the reference; a consistent filter stays below "
                f"{most:.1f} with errors that last as these ({worth.sum():.0f} independent values). Worst is "
                f"{ends[worst].rsplit('_', 1)[0]}: {np.sqrt(squares[worst]):.1f}.",
                f"{_ADVICE[quantity]} Or the reference is not that good.",
            )
        )  # fmt: skip
    return found


def _worth(ratios: NDArray[np.float64]) -> float:
    """Independent values that a series (n,) of errors is worth, at least one."""
    count = len(ratios) / correlation_rows(ratios, centred=False)
    return count if count > KNOWN else 1.0


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
        samples: `tables.replay.REPLAY_SAMPLES`, whose positions count.
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
