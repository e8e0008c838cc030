"""Which beams of four face each other, from the readings alone, and whether they close as a Janus does."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.audit.closure import Slope, closure_slope, suspects
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_RAD, MATERIAL_SCALE, SIGNIFICANCE
from bottomlock.audit.order_odds import log_likelihood
from bottomlock.audit.robust import Array, resolution

PAIRINGS = ((1, 1, -1, -1), (1, -1, 1, -1), (1, -1, -1, 1))
LEAST_SHARE = 0.99
"""A pairing that is less probable is not named."""
TILT_RAD = np.deg2rad(25.0)
"""Where no tilt is stated, a direction that closes badly is judged at this one, amid the usual 20° to 30°."""


@dataclass(frozen=True, eq=False)
class NearestJanus:
    """A pairing: weights (4,) of its closure, its probability of the three, and how its closure follows the velocity.

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
    scores = []
    for signs in PAIRINGS:
        values = 0.5 * readings_mps @ np.array(signs, dtype=np.float64)
        fits = [log_likelihood(values, biased=flag, floor=floor)[0] for flag in (False, True)]
        scores.append(max(fits[0], fits[1] - 0.5 * np.log(len(values))))
    shares = np.exp(np.array(scores) - np.logaddexp.reduce(scores))
    best = int(np.argmax(shares))
    if shares[best] < LEAST_SHARE:
        return None
    weights = np.array(PAIRINGS[best], dtype=np.float64)
    rows = _rows(weights)
    velocity = readings_mps @ np.linalg.pinv(rows).T
    slope = closure_slope(readings_mps @ weights, velocity, row)
    effect, departs = 0.0, False
    if slope is not None:
        effect = float(np.sqrt(slope.slope @ np.cov(velocity, rowvar=False) @ slope.slope))
        blamed = suspects(slope, weights, rows)
        small = any(one.angle_rad < MATERIAL_RAD or abs(one.scale) < MATERIAL_SCALE for one in blamed[:1])
        departs = slope.p_value < SIGNIFICANCE and effect > MATERIAL_MPS and not small
    return NearestJanus(weights, float(shares[best]), slope, effect, departs)


def _rows(weights: Array) -> Array:
    """(4, 3) a Janus whose closure has these weights: beams of one sign face each other."""
    turn = np.empty(4)
    turn[weights > 0.0], turn[weights < 0.0] = (0.0, np.pi), (0.5 * np.pi, 1.5 * np.pi)
    x, y = np.cos(turn) * np.sin(TILT_RAD), np.sin(turn) * np.sin(TILT_RAD)
    return np.stack([x, y, np.full(4, np.cos(TILT_RAD))], axis=1)
