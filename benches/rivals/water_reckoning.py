"""Dead reckoning where the bottom is lost: the last velocity, the water's, or the water's with the recent current.

What vehicles without a filter do. Attitude by the gyros, its yaw drawn slowly to the compass where there is one. While
the bottom determines the velocity, that is the velocity; a current is the difference of what bottom and water determine
within half a second of each other, in tangent axes. Nothing is claimed of the position: no source states a covariance.
"""

from collections import deque
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.dead_reckoning import DeadReckoner, dead_reckoned
from benches.rivals.strapdown import Motion
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]
Use = Literal["held", "alone", "recent"]

RECENT_S = 120.0
"""How far back the mean of the current goes."""
TOGETHER_S = 0.5
"""A ping of the bottom and one of the water that are no further apart make a current; without one the water is used."""
COMPASS_GAIN = 0.02
"""Part of the difference to the compass that is taken at a reading: a mean over 50 of them."""


class WaterReckoner(DeadReckoner):
    """The last velocity over ground, or that through the water with a current.

    The strapdown adds every sample of a stretch, so that a second at once is as good as ten tenths.
    """

    period_ns = 1_000_000_000

    def __init__(self, mission: Mission, use: Use) -> None:
        super().__init__(mission, window=1)
        self.use: Use = use
        self.bottom_t: tuple[float, Floats] | None = None
        self.through_t: tuple[float, Floats] | None = None
        self.currents: deque[tuple[float, Floats]] = deque()

    def measure(self, kind: str, value: Floats) -> None:
        """Pings of bottom and water, and the compass."""
        if kind == "ping":
            self._ping(value)
        elif kind == "water" and self.use != "held":
            self._water(value[0])
        elif kind == "heading":
            off = rotations.wrapped(value - rotations.yaw_rad(self.rotation))
            self.rotation = rotations.exp(np.array([0.0, 0.0, COMPASS_GAIN * off[0]])) @ self.rotation

    def _ping(self, beams_mps: Floats) -> None:
        over_ground = self._solved(beams_mps)
        if over_ground is None:
            return
        self.velocity_p_mps = over_ground
        self.bottom_t = self.time_s, self.rotation @ self.velocity_p_mps
        self._pair()

    def _water(self, beams_mps: Floats) -> None:
        through = self._solved(beams_mps)
        if through is None:
            return
        self.through_t = self.time_s, self.rotation @ through
        self._pair()
        if self.bottom_t is None or self.time_s - self.bottom_t[0] > TOGETHER_S:
            self.velocity_p_mps = through + self.rotation.T @ self.current_t_mps()

    def _pair(self) -> None:
        """A current where both have just been read."""
        if self.bottom_t is None or self.through_t is None:
            return
        if abs(self.bottom_t[0] - self.through_t[0]) <= TOGETHER_S:
            self.currents.append((self.time_s, self.bottom_t[1] - self.through_t[1]))
            self.through_t = None

    def current_t_mps(self) -> Floats:
        """Mean over `RECENT_S` before the last current, north and east; zero without any, and for `alone`."""
        if self.use == "alone" or not self.currents:
            return np.zeros(3)
        last = self.currents[-1][0]
        while self.currents[0][0] < last - RECENT_S:
            self.currents.popleft()
        mean: Floats = np.mean([current for _, current in self.currents], axis=0)
        return mean * [1.0, 1.0, 0.0]

    def _solved(self, beams_mps: Floats) -> Floats | None:
        """The velocity that the beams determine, less what the lever arms add (3,)."""
        solved = self.sensors.velocity(beams_mps, self.omega_p_radps)
        if solved is None:
            return None
        still = self.start.with_motion(Motion(self.rotation, np.zeros(3), np.zeros(3)))
        velocity: Floats = solved.value - solved.predict(still)
        return velocity


def estimate_held(mission: Mission) -> Estimates:
    """The last velocity over ground, in platform axes."""
    return _reckoned(mission, "held")


def estimate_alone(mission: Mission) -> Estimates:
    """The velocity through the water, as if there were no current."""
    return _reckoned(mission, "alone")


def estimate_recent(mission: Mission) -> Estimates:
    """The velocity through the water and the mean current of the last two minutes with both."""
    return _reckoned(mission, "recent")


def _reckoned(mission: Mission, use: Use) -> Estimates:
    return replace(dead_reckoned(mission, lambda: WaterReckoner(mission, use)), position_cov=None)
