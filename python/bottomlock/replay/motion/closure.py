"""Closure of redundant beams: what no velocity contributes to, and which order of the beams closes."""

import itertools
from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.streams import Flags, Floats
from bottomlock.statistics.robust import sd_about_zero

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
