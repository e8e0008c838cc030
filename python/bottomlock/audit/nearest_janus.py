"""Which beams of four face each other, from the readings alone, and whether they close as a Janus does."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from bottomlock.audit.closure import Slope, closure_slope, suspects
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_RAD, MATERIAL_SCALE, SIGNIFICANCE
from bottomlock.audit.order_odds import advantage, log_likelihoods
from bottomlock.audit.robust import Array, resolution

PAIRINGS = ((1, 1, -1, -1), (1, -1, 1, -1), (1, -1, -1, 1))
LEAST_SHARE = 0.99
"""A pairing that is less probable is not named."""
TILT_RAD = np.deg2rad(25.0)
"""Where no tilt is stated, a direction that closes badly is judged at this one, amid the usual 20° to 30°."""


@dataclass(frozen=True, eq=False)
class NearestJanus:
    """A pairing: weights (4,) of its closure, its probability against the next, how its closure follows the velocity.

    `departs` is True where that is significant, and more than a beam that is not reported.
    """

    weights: Array
    share: float
    slope: Slope | None
    effect_mps: float
    departs: bool


def nearest_janus(readings_mps: Array, row: NDArray[np.int64]) -> NearestJanus | None:
    """The pairing that readings (n, 4) of full pings at rows (n,) of the log show; None where they do not decide.

    Noise that is unequal, or correlated, moves the combination of least spread, but not the three closures of a Janus:
    their weights have equal sizes.
    """
    if readings_mps.shape[1] != 4:
        return None
    floor = max(resolution(column) for column in readings_mps.T) / np.sqrt(12.0)
    fits = []
    for signs in PAIRINGS:
        values = 0.5 * readings_mps @ np.array(signs, dtype=np.float64)
        fits.append(log_likelihoods(values, biased=True, floor=floor)[0])
    best, second = np.argsort([-fit.sum() for fit in fits])[:2]
    share = float(norm.cdf(advantage(fits[best], fits[second])))
    if share < LEAST_SHARE:
        return None
    weights = np.array(PAIRINGS[best], dtype=np.float64)
    rows = _rows(weights)
    velocity = readings_mps @ np.linalg.pinv(rows).T
    slope = closure_slope(readings_mps @ weights, velocity, row)
    effect, departs = 0.0, False
    if slope is not None:
        effect = float(np.sqrt(slope.slope @ np.cov(velocity, rowvar=False) @ slope.slope))
        blamed = suspects(slope, weights, rows)
        turned = blamed[0].share_turned >= blamed[0].share_scaled
        matters = blamed[0].angle_rad > MATERIAL_RAD if turned else abs(blamed[0].scale) > MATERIAL_SCALE
        departs = slope.p_value < SIGNIFICANCE and effect > MATERIAL_MPS and matters
    return NearestJanus(weights, share, slope, effect, departs)


def _rows(weights: Array) -> Array:
    """(4, 3) a Janus whose closure has these weights: beams of one sign face each other."""
    turn = np.empty(4)
    turn[weights > 0.0], turn[weights < 0.0] = (0.0, np.pi), (0.5 * np.pi, 1.5 * np.pi)
    x, y = np.cos(turn) * np.sin(TILT_RAD), np.sin(turn) * np.sin(TILT_RAD)
    return np.stack([x, y, np.full(4, np.cos(TILT_RAD))], axis=1)
