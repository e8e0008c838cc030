"""Velocities of pings by least squares, and an order of their beams that closes better."""

from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.closure import orders_by_closure
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


CLOSES_BETTER = 2.5
"""Exchanged beams are a finding from this ratio of the closures."""
ALIKE = 1.15
"""Orders whose closures differ by less than this factor are told apart by nothing."""
LEAST_PINGS = 30


@dataclass(frozen=True)
class BetterOrder:
    """Beams that close better in another order.

    Attributes:
        pings: pings of all beams.
        stated_mps, best_mps: closure as stated, and of the best order.
        words: the beams that may be exchanged, where fewest are.
    """

    pings: int
    stated_mps: float
    best_mps: float
    words: str

    @property
    def ratio(self) -> float:
        """How many times better the beams close."""
        return self.stated_mps / self.best_mps


def better_order(
    directions_p: Floats, velocity_mps: Floats, valid: Flags, claimed_mps: float
) -> BetterOrder | None:
    """Another order of four or five beams in which they close far better; None where the stated one is as good."""
    full = valid.all(axis=1)
    if not 4 <= len(directions_p) <= 5 or full.sum() < LEAST_PINGS:
        return None
    orders = orders_by_closure(velocity_mps[full], directions_p, signs=False)
    stated, best = next(one for one in orders if not one.steps).closure_mps, orders[0].closure_mps
    if stated < CLOSES_BETTER * max(best, 0.5 * claimed_mps):
        return None
    moved = [one.moved for one in orders if one.closure_mps < ALIKE * best]
    fewest = min(map(len, moved))
    words = (" and ".join(str(k + 1) for k in one) for one in moved if len(one) == fewest)
    return BetterOrder(int(full.sum()), stated, best, ", or ".join(words))
