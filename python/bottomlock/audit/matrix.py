"""Beam matrix from the instrument's own velocity: directions, scale, bias; and its match with stated directions.

The instrument computes its velocity from the beams, so that the regression gives the matrix that the instrument *uses*.
Whether the transducers are mounted so is tested by `closure` and by an independent velocity.

Two regressions give it. Where the instrument solves unweighted least squares, `v = A⁺ y + c` holds to rounding: the
regression of the velocity on the readings gives A⁺, and A is its pseudo-inverse, whatever the noise of the beams (the
same noise is in the readings and in the velocity). The reverse regression, `y = A v + bias`, is biased where the beams
are not equally noisy, because the velocity contains their noise, but it does not require that the instrument uses these
readings alone. The first is used where it fits far better than the second.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from bottomlock.audit.logs import Array
from bottomlock.audit.robust import LEAST_BLOCKS, fit_linear
from bottomlock.recordings.robust import sd_about_median
from bottomlock.statistics.rms import rms

LEAST_PINGS = 40
"""Least number of full pings for a regression."""

READINGS_TO_VELOCITY = "velocity regressed on readings"
VELOCITY_TO_READINGS = "readings regressed on velocity"
FAR_BETTER = 0.2
LEAST_MOTION = 0.3
"""Residuals above this fraction of the motion bias a regression by a tenth: coarse rounding, or a vehicle at rest."""
OBSERVABLE_RAD = np.deg2rad(2.0)
"""A direction with a larger standard deviation is not observable in the log."""
NEAR_RAD = np.deg2rad(15.0)
"""A beam within this of a stated one is that beam with a wrong tilt."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """The beam matrix by regression against the instrument's velocity.

    Attributes:
        rows: (beams, 3) row i is scale × direction of beam i.
        resampled: (r, beams, 3) bootstrap copies.
        bias_mps: (beams,) reading at zero velocity; the part that acts like a velocity is not observable.
        bias_sd_mps: (beams,) its standard deviation.
        residual_mps: robust sigma of the residuals.
        excitation_mps: robust sigma of the velocity along the axis in which it varies least.
        regression: which regression was used.
        pings: number of pings used.
        blocks: number of independent blocks behind the standard deviations.
    """

    rows: Array
    resampled: Array
    bias_mps: Array
    bias_sd_mps: Array
    residual_mps: float
    excitation_mps: float
    regression: str
    pings: int
    blocks: int

    @property
    def scale(self) -> Array:
        """(beams,) length of each row: 1 where the instrument's velocity has the scale of its beams."""
        return np.asarray(np.linalg.norm(self.rows, axis=1))

    @property
    def scale_sd(self) -> Array:
        """(beams,)."""
        return np.asarray(np.std(np.linalg.norm(self.resampled, axis=2), axis=0))

    @property
    def directions(self) -> Array:
        """(beams, 3) unit vectors in the frame of the instrument's velocity."""
        return self.rows / np.maximum(self.scale, 1e-12)[:, None]

    @property
    def direction_sd_rad(self) -> Array:
        """(beams,) standard deviation of a direction: root mean square angle to the copies."""
        length = np.maximum(np.linalg.norm(self.resampled, axis=2), 1e-12)
        cosine = np.einsum("rbi,bi->rb", self.resampled, self.directions) / length
        return rms(np.arccos(np.clip(cosine, -1.0, 1.0)), axis=0)

    @property
    def observable(self) -> NDArray[np.bool_]:
        """(beams,) True where the direction is observable: a small deviation, and a motion well above the residuals.

        From too few independent blocks there is no deviation, and nothing is observable.
        """
        moves = self.residual_mps < LEAST_MOTION * self.excitation_mps and self.blocks >= LEAST_BLOCKS
        return np.asarray((self.direction_sd_rad < OBSERVABLE_RAD) & (self.scale > 0.1) & moves)

    @property
    def tilt_rad(self) -> Array:
        """(beams,) angle from the z axis; more than π/2 for a beam with reversed sign."""
        return tilt(self.directions)

    @property
    def azimuth_rad(self) -> Array:
        """(beams,) angle from x towards y."""
        return azimuth(self.directions)

    @property
    def tilt_sd_rad(self) -> Array:
        """(beams,)."""
        return np.asarray(np.std(tilt(self.resampled), axis=0))

    @property
    def azimuth_sd_rad(self) -> Array:
        """(beams,)."""
        off = azimuth(self.resampled) - self.azimuth_rad
        return np.asarray(np.std((off + np.pi) % (2.0 * np.pi) - np.pi, axis=0))


def tilt(vectors: Array) -> Array:
    """Angle from the z axis of vectors (..., 3).

    >>> np.rad2deg(tilt(np.array([1.0, 0.0, 1.0]))).round(6).item()
    45.0
    """
    return np.asarray(np.arctan2(np.hypot(vectors[..., 0], vectors[..., 1]), vectors[..., 2]))


def azimuth(vectors: Array) -> Array:
    """Angle from x towards y of vectors (..., 3).

    >>> np.rad2deg(azimuth(np.array([0.0, 1.0, 1.0]))).round(6).item()
    90.0
    """
    return np.asarray(np.arctan2(vectors[..., 1], vectors[..., 0]))


def find_matrix(readings_mps: Array, velocity_mps: Array) -> Matrix | None:
    """Beam matrix from readings (n, beams) and the instrument's velocity (n, 3), m/s; None from too few pings.

    Examples:
        >>> rng = np.random.default_rng(1)
        >>> A = np.array([[0.3, 0, 0.95], [0, 0.3, 0.95], [-0.3, 0, 0.95], [0, -0.3, 0.95]])
        >>> readings = rng.normal(size=(200, 3)) @ A.T + rng.normal(size=(200, 4)) * [0.3, 0.1, 0.1, 0.1]
        >>> found = find_matrix(readings, readings @ np.linalg.pinv(A).T)
        >>> found.regression, bool(np.abs(found.rows - A).max() < 1e-12)
        ('velocity regressed on readings', True)
    """
    count = len(readings_mps)
    if count < LEAST_PINGS or readings_mps.shape[1] < 3:
        return None
    one = np.ones((count, 1))
    to_readings = fit_linear(np.hstack([velocity_mps, one]), readings_mps)
    to_velocity = fit_linear(np.hstack([readings_mps, one]), velocity_mps)
    forward, backward = (
        float(np.mean(sd_about_median(fit.residuals, axis=0))) for fit in (to_readings, to_velocity)
    )
    axes = np.linalg.svd(velocity_mps - np.median(velocity_mps, axis=0), full_matrices=False)[2]
    moved = float(sd_about_median(velocity_mps @ axes.T, axis=0).min())
    if backward >= FAR_BETTER * forward:
        rows, copies = to_readings.parameters[:3].T, np.swapaxes(to_readings.resampled[:, :3], 1, 2)
        sd = np.std(to_readings.resampled[:, 3], axis=0)
        bias, how = to_readings.parameters[3], VELOCITY_TO_READINGS
        return Matrix(rows, copies, bias, sd, forward, moved, how, count, to_readings.blocks)
    rows, copies = _inverse(to_velocity.parameters), _inverse(to_velocity.resampled)
    bias = -rows @ to_velocity.parameters[-1]
    sd = np.std(np.einsum("rbi,ri->rb", copies, to_velocity.resampled[:, -1]), axis=0)
    return Matrix(rows, copies, bias, sd, backward, moved, READINGS_TO_VELOCITY, count, to_velocity.blocks)


def _inverse(parameters: Array) -> Array:
    """(..., beams + 1, 3) coefficients of the readings to (..., beams, 3) rows of the beams."""
    return np.asarray(np.linalg.pinv(np.swapaxes(parameters[..., :-1, :], -1, -2), rcond=1e-9))


@dataclass(frozen=True, eq=False)
class Match:
    """Match of found with stated directions: channel k reads sign[k] × the stated beam `beam[k]`, off by `off_rad[k]`.

    `rotation` rotates all stated directions to the found ones; it is the identity unless no match exists without it.
    """

    beam: NDArray[np.int64]
    sign: NDArray[np.int64]
    off_rad: Array
    rotation: Rotation

    @property
    def cost(self) -> tuple[float, int, float]:
        """Of equal fits (a Janus fits after every quarter turn) the one with the fewest changes and the least turn."""
        changes = int(np.sum(self.beam != np.arange(len(self.beam))) + np.sum(self.sign < 0))
        return round(float(self.off_rad.max()), 2), changes, float(self.rotation.magnitude())


def match(found: Array, stated: Array) -> Match:
    """The simplest order, signs and common rotation that bring stated directions (beams, 3) to found ones.

    Rotations about z, and about z with the frame upside down, are tried only where some channel has no stated beam
    within 15°.
    """
    plain = _assign(found, stated, Rotation.identity())
    if np.all(plain.off_rad < NEAR_RAD) or np.sum(plain.off_rad > NEAR_RAD) <= len(found) // 4:
        return plain
    yaws = Rotation.from_euler("z", np.arange(0.0, 360.0, 15.0)[:, None], degrees=True)
    upside_down = Rotation.from_euler("x", np.pi)
    turns = [turn for turned in (yaws, upside_down * yaws) for turn in turned]
    best = min((_assign(found, stated, turn) for turn in turns), key=lambda one: one.cost)
    if best.off_rad.max() > 0.5 * plain.off_rad.max():
        return plain
    rotation, _ = Rotation.align_vectors(found, best.sign[:, None] * stated[best.beam])
    return _assign(found, stated, rotation)


def _assign(found: Array, stated: Array, rotation: Rotation) -> Match:
    cosine = found @ rotation.apply(stated).T
    angle = np.arccos(np.clip(np.abs(cosine), -1.0, 1.0))
    rows, order = linear_sum_assignment(angle**2)
    # A channel with another channel's beam is a copy of it, not a beam with a wrong tilt.
    nearest = np.argmin(angle, axis=1)
    copy = (angle[rows, order] > NEAR_RAD) & (angle[rows, nearest] < NEAR_RAD)
    order = np.where(copy, nearest, order)
    sign = np.where(cosine[rows, order] < 0.0, -1, 1)
    return Match(order, sign, angle[rows, order], rotation)
