"""Where a geometry file says that the DVL sits, for comparison with where a log shows it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import find_matrix
from bottomlock.audit.robust import Array
from bottomlock.kernel import BeamGeometry


def _zeros() -> Array:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class Mounted:
    """A stated mounting: roll, pitch, yaw (3,), rad, from DVL to platform axes; lever arm (3,), m, platform frame."""

    rpy_rad: Array = field(default_factory=_zeros)
    lever_arm_p_m: Array = field(default_factory=_zeros)

    @classmethod
    def of(cls, geometry: BeamGeometry, rpy_rad: ArrayLike) -> "Mounted":
        """Of a geometry that contains this mounting; the lever arm is the mean of its beams'."""
        return cls(np.array(rpy_rad, dtype=np.float64), np.asarray(geometry.lever_arms_p_m).mean(axis=0))

    @property
    def rotation(self) -> Rotation:
        """From DVL axes to platform axes."""
        return Rotation.from_euler("ZYX", self.rpy_rad[::-1])

    def directions(self, geometry: BeamGeometry, log: BeamLog) -> tuple[Array, "Mounted"]:
        """Stated rows (beams, 3) in the frame of the instrument's velocity, and the mounting of that frame.

        An instrument may give its velocity in its own axes, or rotate it to the platform's by a mounting that it has
        been told: the frame is taken in which its own solution has the stated beams.
        """
        in_platform = geometry.sound_speed_scale * np.asarray(geometry.directions_p)
        in_own = self.rotation.inv().apply(in_platform)
        if not self.rpy_rad.any() or log.instrument_mps is None or not log.own_frame or log.beams < 3:
            return in_own, self
        pings = log.full & log.solved
        found = find_matrix(log.velocity_mps[pings], log.instrument_mps[pings])
        if found is None or not found.observable.all():
            return in_own, self
        off = [float(np.linalg.norm(found.rows - rows)) for rows in (in_own, in_platform)]
        return (in_own, self) if off[0] <= off[1] else (in_platform, Mounted(np.zeros(3), self.lever_arm_p_m))
