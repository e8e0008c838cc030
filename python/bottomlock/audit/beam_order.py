"""Assignment of the log's channels to the beams of a stated geometry: order, signs, and remaining direction errors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from bottomlock.audit.robust import Array

NEAR_RAD = np.deg2rad(15.0)
"""A beam within this of a stated one is that beam with a wrong tilt; two beams within it are parallel."""


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
    def changes(self) -> int:
        """Channels with another beam than stated, and those of the opposite sign."""
        return int(np.sum(self.beam != np.arange(len(self.beam))) + np.sum(self.sign < 0))


def match(found: Array, stated: Array) -> Match:
    """The simplest order, signs and common rotation that bring stated directions (beams, 3) to found ones.

    Rotations about z, and about z with the frame upside down, are tried only where some channel has no stated beam
    within 15°.
    """
    plain = _assign(found, stated, Rotation.identity())
    if np.all(plain.off_rad < NEAR_RAD) or np.sum(plain.off_rad > NEAR_RAD) <= len(found) // 4:
        return plain
    rotations = [Rotation.from_euler("z", angle, degrees=True) for angle in range(15, 360, 15)]
    rotations += [
        Rotation.from_euler("x", 180.0, degrees=True) * rotation
        for rotation in [Rotation.identity(), *rotations]
    ]
    tried = [_assign(found, stated, rotation) for rotation in rotations]
    # Of equal fits (a Janus fits after every quarter turn) the one with the fewest changes and the least rotation.
    best = min(
        tried,
        key=lambda one: (round(float(one.off_rad.max()), 2), one.changes, one.rotation.magnitude()),
    )
    if best.off_rad.max() > 0.5 * plain.off_rad.max():
        return plain
    moved = best.sign[:, None] * stated[best.beam]
    rotation, _ = Rotation.align_vectors(found, moved)
    return _assign(found, stated, rotation)


def _assign(found: Array, stated: Array, rotation: Rotation) -> Match:
    cosine = found @ rotation.apply(stated).T
    angle = np.arccos(np.clip(np.abs(cosine), -1.0, 1.0))
    channel, beam = linear_sum_assignment(angle**2)
    order = np.empty(len(found), dtype=np.int64)
    order[channel] = beam
    # A channel with another channel's beam is a copy of it, not a beam with a wrong tilt.
    nearest = np.argmin(angle, axis=1)
    rows = np.arange(len(found))
    copy = (angle[rows, order] > NEAR_RAD) & (angle[rows, nearest] < NEAR_RAD)
    order = np.where(copy, nearest, order)
    sign = np.where(cosine[rows, order] < 0.0, -1, 1)
    return Match(order, sign, angle[rows, order], rotation)
