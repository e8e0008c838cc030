"""Vertical velocity from a DVL's velocity and gravity as integrated, without an attitude."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.replay.motion.fit import Match, Recorded, at_pings
from bottomlock.replay.motion.segments import integrate

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def vertical_velocity(recorded: Recorded, match: Match) -> tuple[Integers, Integers, Floats] | None:
    """Times (p,), segments (p,) and velocities down, m/s, (p,); None without a whole segment.

    Args:
        recorded: readings and velocities, as the match was made with.
        match: axes, rotation, clock and biases; its slopes are gravity.
    """
    segments = integrate(
        recorded.imu_time_ns, recorded.force_p_mps2, recorded.omega_p_radps - match.part("gyro_bias")
    )
    if segments is None or segments.count != len(match.level_p):
        return None
    velocity = recorded.velocity_p_mps
    moved = recorded.time_ns + round(float(match.part("clock")[0]) * 1e9)
    at = at_pings(segments, moved)
    v = Rotation.from_rotvec(match.part("rotation")).apply(velocity[at.kept] @ match.axes.T)
    down = match.level_p[at.segment]
    return moved[at.kept], at.segment, np.einsum("pi,pij,pj->p", down, at.C, v)
