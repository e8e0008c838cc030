"""Ocean currents: sheared with depth, and in time turning and Gauss-Markov."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.interpolate import make_interp_spline

from bottomlock.errors import ScenarioError
from bottomlock.plant.maths import FloatArray

_KNOTS_PER_TIME_CONSTANT = 10.0


@dataclass(frozen=True)
class Current:
    """A horizontal current c(t, depth) = mean(t) + shear depth + wander(t), tangent frame, north and east.

    `mean_mps` is at the surface and at time 0, `shear_ps` per metre of depth. The mean turns at `turn_radps`, from
    north to east, as with a tide. The wander is a first-order Gauss-Markov process of standard deviation
    `wander_sd_mps` per axis and time constant `wander_time_s`, drawn from `seed`; it is sampled ten times per time
    constant and interpolated by a cubic spline, so that the vehicle's acceleration is smooth.

    Raises:
        ScenarioError: for a number that is not finite, a negative wander_sd_mps or a wander_time_s of 0 or less.
    """

    mean_mps: tuple[float, float] = (0.0, 0.0)
    shear_ps: tuple[float, float] = (0.0, 0.0)
    wander_sd_mps: float = 0.0
    wander_time_s: float = 120.0
    seed: int = 0
    turn_radps: float = 0.0

    def __post_init__(self) -> None:
        values = (*self.mean_mps, *self.shear_ps, self.wander_sd_mps, self.wander_time_s, self.turn_radps)
        if not all(math.isfinite(value) for value in values):
            raise ScenarioError("every number must be finite", place="current")
        if self.wander_sd_mps < 0.0 or self.wander_time_s <= 0.0:
            raise ScenarioError(
                "wander_sd_mps must not be negative and wander_time_s must be positive", place="current"
            )

    @classmethod
    def towards(cls, speed_mps: float, direction_rad: float) -> Self:
        """A constant current that sets towards a direction (rad from north, east positive)."""
        return cls(mean_mps=(speed_mps * math.cos(direction_rad), speed_mps * math.sin(direction_rad)))

    def columns(self, time_s: FloatArray) -> FloatArray:
        """Surface current (N, E), its rate of change (N, E) and the shear (N, E) at times, shape (n, 6)."""
        time = np.asarray(time_s, dtype=np.float64)
        table = np.zeros((len(time), 6))
        (north, east), turned = self.mean_mps, self.turn_radps * time
        sine, cosine = np.sin(turned), np.cos(turned)
        mean = np.column_stack([north * cosine - east * sine, north * sine + east * cosine])
        table[:, 0:2] = mean
        table[:, 2:4] = self.turn_radps * np.column_stack([-mean[:, 1], mean[:, 0]])
        table[:, 4:6] = self.shear_ps
        if self.wander_sd_mps > 0.0:
            spline = self._wander(float(time[-1]))
            table[:, 0:2] += spline(time)
            table[:, 2:4] += spline(time, 1)
        return table

    def _wander(self, duration_s: float) -> Callable[..., FloatArray]:
        spacing = self.wander_time_s / _KNOTS_PER_TIME_CONSTANT
        # knots at a spacing that does not depend on the duration: a longer run begins with the same current
        count = max(8, math.ceil(duration_s / spacing) + 5)
        memory = math.exp(-1.0 / _KNOTS_PER_TIME_CONSTANT)
        draws = np.random.default_rng([self.seed, 0xC0]).standard_normal((count, 2))
        knots = np.empty_like(draws)
        knots[0] = draws[0]
        for index in range(1, count):
            knots[index] = memory * knots[index - 1] + math.sqrt(1.0 - memory**2) * draws[index]
        times = spacing * (np.arange(count) - 1.0)
        spline: Callable[..., FloatArray] = make_interp_spline(times, self.wander_sd_mps * knots, k=3)
        return spline
