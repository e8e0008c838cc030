"""Closure of redundant beams: combinations of their readings to which no velocity contributes, of noise alone.

What closes tells the order of the beams: one that is not theirs has the velocity in its closure.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.recordings.finding import beam_words
from bottomlock.recordings.robust import sd_about_median, sd_about_zero
from bottomlock.recordings.streams import Floats

SMALLEST = 1e-9
"""Of the largest singular value: below it, a direction is none."""


def closure_rows(directions_p: ArrayLike) -> NDArray[np.float64]:
    """(B − rank, B) orthonormal combinations n with n · A v = 0 for every v, A the (B, 3) directions of the beams.

    There are none for three independent beams or fewer. The first component of each is not negative.

    Examples:
        The four beams of a Janus have one, with alternating signs and unit length, so that its value scatters as one
        beam:

        >>> from bottomlock.kernel import BeamGeometry
        >>> closure_rows(BeamGeometry.janus(0.35).directions_p).round(3).tolist()
        [[0.5, -0.5, 0.5, -0.5]]
    """
    directions = np.asarray(directions_p, dtype=np.float64)
    if not len(directions):
        return np.zeros((0, 0))
    left, values, _ = np.linalg.svd(directions)
    null = left[:, int((values > SMALLEST * values[0]).sum()) :].T
    # The sign of a singular vector is arbitrary.
    signs = np.where(null[:, :1] < 0.0, -1.0, 1.0)
    return np.ascontiguousarray(null * signs)


def closure_sd(directions_p: ArrayLike, velocity_mps: Floats, *, biased: bool = False) -> float:
    """Robust size of the closures of readings (n, B), m/s, RMS over the combinations of unit length; NaN without any.

    It is about zero, as a steady course gives a wrong order a constant closure; about the median where the closure may
    be biased.
    """
    rows = closure_rows(directions_p)
    sd = sd_about_median if biased else sd_about_zero
    return float(np.sqrt(np.mean(sd(velocity_mps @ rows.T, axis=0) ** 2))) if len(rows) else float("nan")


@dataclass(frozen=True)
class Order:
    """A beam order: channel k reads sign[k] × beam[k], and closes to `closure_mps`.

    `steps` counts swaps and sign flips; the simplest explanation has the fewest.
    """

    beam: tuple[int, ...]
    sign: tuple[int, ...]
    steps: int
    closure_mps: float

    @property
    def moved(self) -> tuple[int, ...]:
        """Channels with another beam than stated."""
        return tuple(k for k, beam in enumerate(self.beam) if beam != k)

    @property
    def flipped(self) -> tuple[int, ...]:
        """Channels of the opposite sign of the stated beam."""
        return tuple(k for k, sign in enumerate(self.sign) if sign < 0)

    @property
    def words(self) -> str:
        """What to change."""
        parts = ((self.moved, "exchanged"), (self.flipped, "flipped in sign"))
        return " and ".join(f"{beam_words(beams)} {done}" for beams, done in parts if beams)


def orders_by_closure(readings_mps: Floats, stated: Floats) -> list[Order]:
    """Every order within two swaps or flips of the stated one with its closure over full pings, the least first.

    Orders with the same null space have the same closure; they are ranked by the number of their steps.

    Args:
        readings_mps: (n, B).
        stated: (B, 3) directions of the beams.
    """
    beams = len(stated)
    pairs = list(itertools.combinations(range(beams), 2))
    swaps = [_swapped(range(beams), pair) for pair in pairs]
    plain, straight = tuple(range(beams)), (1,) * beams
    flips = [_flipped(straight, [k]) for k in range(beams)]
    tried = [(0, plain, straight)]
    tried += [*((1, swap, straight) for swap in swaps), *((1, plain, flip) for flip in flips)]
    tried += [(2, _swapped(swap, pair), straight) for swap in swaps for pair in pairs]
    tried += [(2, plain, _flipped(straight, pair)) for pair in pairs]
    tried += [(2, swap, flip) for swap in swaps for flip in flips]
    steps: dict[tuple[tuple[int, ...], tuple[int, ...]], int] = {}
    for count, beam, sign in tried:
        steps.setdefault((beam, sign), count)
    found = []
    for (beam, sign), count in steps.items():
        spread = closure_sd(np.array(sign)[:, None] * stated[list(beam)], readings_mps)
        if np.isfinite(spread):
            found.append(Order(beam, sign, count, spread))
    return sorted(found, key=lambda one: (round(one.closure_mps, 9), one.steps))


ALIKE = 1.1
"""Orders whose closures differ by less than this factor are told apart by nothing."""
MOST = 6
"""Orders that are named."""
BIAS = 0.5
"""Closure of the best order over the scatter of the stated one's from which a bias may be the reason."""


@dataclass(frozen=True, eq=False)
class Reordered:
    """Orders in which the beams close far better than as stated.

    A wrong order gives a steady course a constant closure, as a bias in the stated order does: where the closure of the
    stated order scatters about its median as little as the best closes, the two cannot be told apart.

    Attributes:
        pings: with every beam.
        orders: the simplest of those that close best.
        plain_mps, scatter_mps: closure as stated, about zero and about its median.
    """

    pings: int
    orders: list[Order]
    plain_mps: float
    scatter_mps: float

    @property
    def best_mps(self) -> float:
        """Closure of the best order."""
        return self.orders[0].closure_mps

    @property
    def ratio(self) -> float:
        """How many times better the beams close."""
        return self.plain_mps / max(self.best_mps, 1e-12)

    @property
    def or_bias(self) -> bool:
        """A bias explains it as well."""
        return BIAS * self.scatter_mps < self.best_mps

    @property
    def moved(self) -> list[int]:
        """Channels of any of the orders with another beam or sign than stated."""
        return sorted({k for one in self.orders for k in (*one.moved, *one.flipped)})

    @property
    def words(self) -> str:
        """What to change, in one way or another."""
        return "; or ".join(one.words for one in self.orders[:MOST])


def find_order(readings_mps: Floats, stated: Floats, *, better: float, least_mps: float) -> Reordered | None:
    """The simplest orders in which full pings (n, B) close far better than in the stated one, if any.

    Args:
        readings_mps, stated: of `orders_by_closure`.
        better: largest closure of another order over that of the stated one.
        least_mps: smaller closures are right.
    """
    orders = orders_by_closure(readings_mps, stated)
    plain, best = next(one for one in orders if not one.steps).closure_mps, orders[0].closure_mps
    if best > better * plain or plain < least_mps:
        return None
    equal = [one for one in orders if one.closure_mps < ALIKE * best]
    simple = [one for one in equal if one.steps == min(other.steps for other in equal)]
    return Reordered(len(readings_mps), simple, plain, closure_sd(stated, readings_mps, biased=True))


def _swapped(order: Sequence[int], pair: tuple[int, int]) -> tuple[int, ...]:
    new = list(order)
    new[pair[0]], new[pair[1]] = new[pair[1]], new[pair[0]]
    return tuple(new)


def _flipped(sign: tuple[int, ...], beams: Sequence[int]) -> tuple[int, ...]:
    return tuple(-s if k in beams else s for k, s in enumerate(sign))
