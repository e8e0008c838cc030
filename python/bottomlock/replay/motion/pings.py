"""Velocities of pings by least squares."""

import numpy as np

from bottomlock.recordings.streams import Flags, Floats, Integers

OUTLIER = 5.0
"""Misfits beyond this many times the median are outliers."""
UNSTABLE = 8.0
"""A set of beams that makes the noise larger than this gives no velocity."""


def ping_velocity(
    directions_p: Floats, time_ns: Integers, velocity_mps: Floats, valid: Flags
) -> tuple[Integers, Floats]:
    """Times (p,) and velocities (p, 3), platform frame, of the pings whose beams determine all of it.

    Args:
        directions_p: (B, 3) of the beams.
        time_ns: (n,) times.
        velocity_mps, valid: (n, B).
    """
    found = np.full((len(time_ns), 3), np.nan)
    misfit = np.zeros(len(time_ns))
    patterns, which = np.unique(valid, axis=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        if pattern.sum() < 3:
            continue
        B = directions_p[pattern]
        inverse = np.linalg.pinv(B)
        if np.linalg.norm(inverse, 2) > UNSTABLE:
            continue
        rows = np.flatnonzero(which.ravel() == k)
        y = velocity_mps[rows][:, pattern]
        found[rows] = y @ inverse.T
        if pattern.sum() > 3:
            misfit[rows] = np.linalg.norm(y - found[rows] @ B.T, axis=1)
    tested = misfit > 0.0
    if tested.any():
        found[misfit > OUTLIER * max(float(np.median(misfit[tested])), 1e-6)] = np.nan
    good = np.isfinite(found).all(axis=1)
    return time_ns[good], found[good]
