"""Before the first bottom lock: the velocity of the start, held as if it were measured.

Where no beam returns, the product of the errors of velocity and attitude outgrows within seconds what filters that are
linear in them claim, and where no ping has determined the velocity yet, some never find back: missions that begin with
a minute or more of few beams were lost to them. So until a ping has determined the velocity, the start's is taken
wherever no beam returns, with a covariance that grows as a random walk of the start's own 1 sigma in a second
(`held_velocity.memory_at_start`).
"""

import numpy as np
from numpy.typing import NDArray

from partialdvl_bench.mission import Mission

Floats = NDArray[np.float64]


class HeldStart:
    """The velocity that a mission begins with, until the first ping that determines the velocity."""

    def __init__(self, mission: Mission) -> None:
        self.directions_p = np.asarray(mission.geometry.directions_p)
        self.velocity_p_mps = np.array(mission.start.velocity_p_mps, dtype=np.float64)
        self.sd_mps = np.array(mission.model.initial.velocity_sd_mps)
        self.waits = True

    def holds(self, returned: NDArray[np.bool_]) -> bool:
        """Whether the start's velocity is taken at a ping of which these beams returned (B,)."""
        self.waits = self.waits and int(np.linalg.matrix_rank(self.directions_p[returned])) < 3
        return self.waits and not returned.any()

    def velocity(self, since_s: float) -> tuple[Floats, Floats]:
        """Of the platform, m/s (3,), and its covariance (3, 3) this long after the start."""
        return self.velocity_p_mps, np.diag(self.sd_mps**2 * (1.0 + since_s))
