"""Velocities of pings by least squares, and the closure of redundant beams, to which no velocity contributes."""

import itertools
from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.robust import sd_about_zero
from bottomlock.recordings.streams import Flags, Floats, Integers

OUTLIER = 5.0
"""Closures beyond this many robust sigmas are outliers."""
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


def closure_sd(directions_p: Floats, velocity_mps: Floats) -> float:
    """Robust sigma of the readings along the combinations that no velocity contributes to, m/s; NaN without any."""
    null = closure_rows(directions_p)
    return float(sd_about_zero(velocity_mps @ null.T)) if len(null) else float("nan")


@dataclass(frozen=True)
class BetterOrder:
    """Beams that close better in another order.

    Attributes:
        pings: pings of all beams.
        stated_mps, best_mps: closure as stated, and of the best order.
        moved: of each of the orders that close alike, the beams that change places, those that move fewest first.
    """

    pings: int
    stated_mps: float
    best_mps: float
    moved: list[list[str]]

    @property
    def ratio(self) -> float:
        """How many times better the beams close."""
        return self.stated_mps / self.best_mps

    @property
    def words(self) -> str:
        """The beams that may be exchanged, where fewest are."""
        return ", or ".join(" and ".join(one) for one in self.moved if len(one) == len(self.moved[0]))


def better_order(
    directions_p: Floats, velocity_mps: Floats, valid: Flags, claimed_mps: float
) -> BetterOrder | None:
    """Another order of four or five beams in which they close far better; None where the stated one is as good."""
    full = valid.all(axis=1)
    beams = len(directions_p)
    if not 4 <= beams <= 5 or full.sum() < LEAST_PINGS:
        return None
    y = velocity_mps[full]
    stated = closure_sd(directions_p, y)
    orders = list(itertools.permutations(range(beams)))
    sizes = np.array([closure_sd(directions_p[list(order)], y) for order in orders])
    best = float(sizes.min())
    if stated < CLOSES_BETTER * max(best, 0.5 * claimed_mps):
        return None
    near = [order for order, size in zip(orders, sizes, strict=True) if size < ALIKE * best]
    near.sort(key=lambda order: sum(k != j for k, j in enumerate(order)))
    moved = [[str(k + 1) for k, j in enumerate(order) if k != j] for order in near]
    return BetterOrder(int(full.sum()), stated, best, moved)
