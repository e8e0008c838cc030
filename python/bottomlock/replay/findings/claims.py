"""Errors against a reference over claimed sigma, where they are far beyond chi-squared."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.files.replay_tables import FORWARD
from bottomlock.recordings.finding import Finding
from bottomlock.recordings.robust import correlation_rows
from bottomlock.replay.findings.innovations import PREFERRED
from bottomlock.replay.findings.limits import HIGH_RATIO, PROBABILITY

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


def claims_findings(
    samples: pl.DataFrame, methods: Sequence[str], reference_sd_m: float = 0.0
) -> list[Finding]:
    """Position, velocity and attitude whose errors over claimed σ are far beyond chi-squared.

    Errors last: a series is worth as many values as it has correlation times, at least one an axis. The first sample is
    the start itself, whose deviations are given.

    Args:
        samples: `files.replay_tables.REPLAY_SAMPLES` of the recording.
        methods: of the case.
        reference_sd_m: 1 sigma of a position of the reference along an axis, which is in its errors.
    """
    used = [m for m in (*PREFERRED, *methods) if m in methods and m != "ins"]
    if not used:
        return []
    rows = samples.filter((pl.col("pass") == FORWARD) & (pl.col("method") == used[0])).slice(1)
    found = []
    for quantity, (what, ends) in _COMPONENTS.items():
        noise = reference_sd_m if quantity == "position" else 0.0
        ratios = [
            (rows[f"err_{what}_{end}"] / (rows[f"sd_{what}_{end}"] ** 2 + noise**2).sqrt())
            .drop_nulls()
            .to_numpy()
            for end in ends
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
                f"Method {used[0]}, RMS over time and axes against the reference, its noise included; a consistent "
                f"filter stays below {most:.1f} with errors that last as these ({worth.sum():.0f} independent values). "
                f"Worst is {ends[worst].rsplit('_', 1)[0]}: {np.sqrt(squares[worst]):.1f}.",
                f"{_ADVICE[quantity]} Or the reference is not that good.",
            )
        )  # fmt: skip
    return found


def _worth(ratios: NDArray[np.float64]) -> float:
    """Independent values that a series (n,) of errors is worth, at least one."""
    count = len(ratios) / correlation_rows(ratios, centred=False)
    return count if count > KNOWN else 1.0
