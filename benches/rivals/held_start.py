"""Before the first beam: the velocity of the start, held as if it were measured.

With depth and heading alone the product of the errors of velocity and attitude outgrows what filters that are linear in
them claim, within seconds: a mission without beams for its first 90 s was lost to all of them. So until a beam has
returned, the start's velocity is taken at each time of a ping, with a covariance that grows as a random walk of the
start's own 1 sigma in a second (`held_velocity.memory_at_start`).
"""

import numpy as np
from numpy.typing import NDArray

from bottomlock.bench.mission import Mission

Floats = NDArray[np.float64]


class HeldStart:
    """The velocity that a mission begins with, until the first beam."""

    def __init__(self, mission: Mission) -> None:
        self.velocity_p_mps = np.array(mission.start.velocity_p_mps, dtype=np.float64)
        self.sd_mps = np.array(mission.model.initial.velocity_sd_mps)
        self.waits = True

    def see(self, beams: int) -> None:
        """A ping of which so many beams returned."""
        self.waits = self.waits and beams == 0

    def velocity(self, since_s: float) -> tuple[Floats, Floats]:
        """Of the platform, m/s (3,), and its covariance (3, 3) this long after the start."""
        return self.velocity_p_mps, np.diag(self.sd_mps**2 * (1.0 + since_s))
