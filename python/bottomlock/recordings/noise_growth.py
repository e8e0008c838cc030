"""White noise and random walk told apart by how the variance of differences grows with their lag, each with its sigma.

What noise hides is no zero: a walk that does not stand out is what its 1 sigma leaves possible, with no threshold.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.robust import sd_about_median
from bottomlock.recordings.streams import Floats

FAR_OFF = 4.0
"""Robust sigmas beyond which a difference is an outlier."""
TIMES = 10.0
"""Noise of integrated readings over that from one to the next: scale, tilt and low rates add to it."""
FAR_BELOW = -25.0
"""Sigmas below zero from which a Gaussian beyond zero falls off as an exponential."""


@dataclass(frozen=True)
class Walk:
    """Density of a random walk by its square, an estimate of any sign, and the 1 sigma of that."""

    square: float
    sd: float

    def over(self, share: float) -> "Walk":
        """Of a variance that grows by `share` times the square of the density."""
        return Walk(self.square / share, self.sd / share)

    def density(self, scatter: float = 0.0) -> tuple[float, float]:
        """The density, and by 1 sigma the largest that it may be.

        Args:
            scatter: density that the readings have from one to the next: no less, and hardly `TIMES` more; 0 for one
                that is not known.
        """
        least, usual = scatter**2, (TIMES * scatter) ** 2
        excess = self.square - least - (self.sd**2 / usual if usual > 0.0 else 0.0)
        mean, sd = not_negative(excess, self.sd)
        return math.sqrt(least + mean), math.sqrt(least + mean + sd)


@dataclass(frozen=True, eq=False)
class NoiseGrowth:
    """Variance of differences over a time T as white + walk × T.

    Attributes:
        white, walk_of: (3,) of each axis, not negative.
        walk: the mean over the axes.
    """

    white: Floats
    walk_of: Floats
    walk: Walk


def noise_growth(differences: Sequence[tuple[int, Floats]], step_s: float) -> NoiseGrowth | None:
    """White noise and walk of differences; None of fewer than two lags.

    Args:
        differences: lags, in steps, and (n, 3) differences over each.
        step_s: length of a step.
    """
    if len(differences) < 2:
        return None
    spreads = np.array([_variance(moved) for _, moved in differences])
    apart_s = step_s * np.array([lag for lag, _ in differences])
    # A variance of n differences over a lag is known to about this part of itself (by simulation).
    part = np.sqrt([lag / len(moved) for lag, moved in differences])
    weight = 1.0 / (part * np.maximum(spreads.mean(axis=1), 1e-20))
    A, b = weight[:, None] * np.stack([np.ones(len(part)), apart_s], axis=1), weight[:, None] * spreads
    level, steep = np.linalg.lstsq(A, b, rcond=None)[0]
    share = float(np.sqrt((spreads**2).sum(axis=1)).mean() / max(float(spreads.sum(axis=1).mean()), 1e-30))
    sd = share * math.sqrt(float(np.linalg.inv(A.T @ A)[1, 1]))
    flat = (weight @ b) / float(weight @ weight)
    white = np.maximum(np.where(steep > 0.0, level, flat), 0.0)
    return NoiseGrowth(white, np.maximum(steep, 0.0), Walk(float(steep.mean()), sd))


def not_negative(value: float, sd: float) -> tuple[float, float]:
    """Mean and 1 sigma of what is not negative, of which a Gaussian estimate may be: that of its part above zero.

    The estimate where it stands out, some of its sigma where noise hides it.

    >>> [tuple(round(one, 2) for one in not_negative(value, 1.0)) for value in (10.0, 2.0, 0.0, -2.0, -50.0)]
    [(10.0, 1.0), (2.06, 0.94), (0.8, 0.6), (0.37, 0.34), (0.02, 0.02)]
    """
    if not sd > 0.0:
        return max(value, 0.0), 0.0
    at = value / sd
    if at < FAR_BELOW:
        return -sd / at * (1.0 - 2.0 / at**2), -sd / at * (1.0 - 3.0 / at**2)
    beyond = math.exp(-0.5 * at * at) / math.sqrt(0.5 * math.pi) / math.erfc(-at / math.sqrt(2.0))
    return sd * (at + beyond), sd * math.sqrt(max(1.0 - beyond * (at + beyond), 0.0))


def _variance(values: Floats) -> Floats:
    """(3,) variance without outliers: twice as certain as one by the median."""
    middle, sd = np.median(values, axis=0), sd_about_median(values, axis=0)
    kept = np.abs(values - middle) <= FAR_OFF * np.maximum(sd, 1e-12)
    return np.asarray(
        (np.where(kept, values - middle, 0.0) ** 2).sum(axis=0) / np.maximum(kept.sum(axis=0), 1)
    )
