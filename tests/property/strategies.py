"""Hypothesis strategies for physics: instruments, velocities, masks, covariances, attitudes, within what occurs at sea.

Numbers are drawn as bounded floats and composed, so that a failing case shrinks to a plain one.
"""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

import bottomlock
from tests.oracle import beams as oracle
from tests.oracle.rotations import Array, matrix_from_euler


def numbers(low: float, high: float, count: int) -> st.SearchStrategy[Array]:
    """A vector of bounded floats."""
    return st.lists(st.floats(low, high), min_size=count, max_size=count).map(np.array)


@dataclass(frozen=True)
class Instrument:
    """A DVL: directions (B, 3), lever arms (B, 3) in metres, 1-sigma noise (B,) in m/s."""

    directions: Array
    levers: Array
    sd: Array

    @property
    def geometry(self) -> bottomlock.BeamGeometry:
        """The same instrument as the product takes it."""
        return bottomlock.BeamGeometry(self.directions, lever_arms_p_m=self.levers)

    @property
    def beams(self) -> int:
        """Number of beams."""
        return len(self.directions)


@st.composite
def instruments(draw: st.DrawFn, least: int = 3, most: int = 5) -> Instrument:
    """Beams roughly evenly round the vertical, each with its own tilt, so that any three are independent."""
    count = draw(st.integers(least, most))
    turn = draw(st.floats(0, 2 * np.pi))
    azimuth = turn + 2 * np.pi * (np.arange(count) + draw(numbers(-0.15, 0.15, count))) / count
    tilt = np.deg2rad(draw(numbers(15, 35, count)))
    directions = np.array([oracle.direction(a, b) for a, b in zip(tilt, azimuth, strict=True)])
    levers = draw(numbers(-1, 1, 3 * count)).reshape(count, 3)
    return Instrument(directions, levers, draw(numbers(0.005, 0.2, count)))


def masks(beams: int, least: int) -> st.SearchStrategy[Array]:
    """Which beams return, at least `least` of them."""
    flags = st.lists(st.booleans(), min_size=beams, max_size=beams).map(np.array)
    return flags.filter(lambda valid: int(valid.sum()) >= least)


velocities = numbers(-5, 5, 3)
rates = numbers(-0.5, 0.5, 3)
angles = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))


@st.composite
def covariances(draw: st.DrawFn, low_sd: float = 0.02, high_sd: float = 1.0) -> Array:
    """A 3 × 3 covariance: principal axes turned at random."""
    sd = draw(numbers(low_sd, high_sd, 3))
    rotation = matrix_from_euler(*draw(angles))
    covariance: Array = rotation @ np.diag(sd**2) @ rotation.T
    return (covariance + covariance.T) / 2
