"""Outliers among the beams in mode velocity, where no filter tests them: what no vehicle and no noise can have done.

A beam is compared with its own reading before, and the beams of a complete ping with one another. The limits follow
from the claimed noise and from the largest acceleration of the vehicle.
"""

import math

import numpy as np
from numpy.typing import NDArray

from bottomlock.kernel import BeamGeometry
from bottomlock.live.closure import whitened_closure

JUMP_SD = 4.0
"""Difference of two readings over its 1 sigma that noise does not reach: once in 16,000 readings."""
CLOSURE_SD = 3.29
"""The same of the closure of a complete ping: once in 1,000."""
OLDEST_S = 2.0
"""Age of a reading with which none is compared any more."""
REOPENED = 3
"""Readings in a row that jump: the next is taken, since it is the vehicle that has moved."""


class BeamJumps:
    """Beams of each ping that are no outliers.

    Args:
        geometry: the beams.
        acceleration_mps2: largest acceleration of the vehicle along a beam.

    Attributes:
        why: what was left out of the last ping; "" if nothing was.
    """

    def __init__(self, geometry: BeamGeometry, acceleration_mps2: float) -> None:
        beams = geometry.beams
        self._geometry, self._acceleration = geometry, acceleration_mps2
        self._before_mps, self._before_ns = np.full(beams, np.nan), np.zeros(beams, dtype=np.int64)
        self._jumped = np.zeros(beams, dtype=np.int64)
        self.why = ""

    def kept(
        self,
        time_ns: int,
        velocity_mps: NDArray[np.float64],
        valid: NDArray[np.bool_],
        sd_mps: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Which beams (n,) of a ping with its claimed noise to use; the next ones are compared with their readings."""
        age_s = np.abs(time_ns - self._before_ns) * 1e-9
        known = valid & np.isfinite(self._before_mps) & (age_s <= OLDEST_S)
        change = np.where(known, np.abs(velocity_mps - self._before_mps), 0.0)
        limit = JUMP_SD * math.sqrt(2.0) * sd_mps + self._acceleration * age_s
        jumped = known & (change > limit) & (self._jumped < REOPENED)
        keep: NDArray[np.bool_] = valid & ~jumped
        if keep.all() and known.any():
            closure = whitened_closure(self._geometry, sd_mps) @ (velocity_mps / sd_mps)
            if closure.size and float(np.abs(closure).max()) > CLOSURE_SD:
                worst = int(np.argmax(change / limit))
                keep[worst] = self._jumped[worst] >= REOPENED
        left_out = valid & ~keep
        self._jumped = np.where(left_out, self._jumped + 1, np.where(valid, 0, self._jumped))
        self._before_mps = np.where(keep, velocity_mps, self._before_mps)
        self._before_ns = np.where(keep, time_ns, self._before_ns)
        beams = ", ".join(str(beam + 1) for beam in np.flatnonzero(left_out))
        self.why = f"no vehicle changes its velocity so: beam {beams} left out" if beams else ""
        return keep
