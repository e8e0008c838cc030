"""Initial alignment of a live start: level by the accelerometers, heading given, velocity by the beams or given."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.levelling import level_from_force
from bottomlock.live.sections import StartSection
from bottomlock.models import InitialState
from bottomlock.ports.rotation import quaternion

PING_AGE_NS = 1_000_000_000
"""Greatest age of the ping that gives the initial velocity."""
Floats = NDArray[np.float64]


class Alignment:
    """Collects what a start needs; `state` gives it once everything is there."""

    def __init__(self, start: StartSection) -> None:
        self._start = start
        self._window_ns = units.ns_from_s(start.window_s)
        self._readings: deque[tuple[int, Floats]] = deque()
        self._velocity: tuple[int, Floats] | None = None

    def imu(self, time_ns: int, force_p_mps2: Floats) -> None:
        """Takes an inertial reading; one that does not follow the others begins a new window."""
        readings = self._readings
        if readings and not 0 < time_ns - readings[-1][0] <= self._window_ns:
            readings.clear()
        readings.append((time_ns, force_p_mps2))
        while len(readings) > 2 and time_ns - readings[1][0] >= self._window_ns:
            readings.popleft()

    def velocity(self, time_ns: int, velocity_p_mps: Floats) -> None:
        """Takes the velocity (3,) of a ping that determines the whole of it."""
        self._velocity = time_ns, velocity_p_mps

    @property
    def waiting_for(self) -> str:
        """What is still missing, in words; "" where nothing is."""
        if not self._readings:
            return "inertial readings"
        span_ns = self._readings[-1][0] - self._readings[0][0]
        if span_ns < self._window_ns:
            return f"the alignment, {span_ns * 1e-9:.0f} of {self._start.window_s:g} s"
        if self._start.velocity == "beams" and self._velocity_now() is None:
            return "a ping that determines the whole velocity"
        return ""

    def _velocity_now(self) -> Floats | None:
        if self._velocity is None or abs(self._readings[-1][0] - self._velocity[0]) > PING_AGE_NS:
            return None
        return self._velocity[1]

    def state(self) -> InitialState:
        """The state at the last inertial reading, once `waiting_for` is empty."""
        start = self._start
        roll, pitch = level_from_force(np.mean([force for _, force in self._readings], axis=0))
        measured = self._velocity_now() if start.velocity == "beams" else None
        return InitialState(
            time_ns=self._readings[-1][0],
            position_t_m=start.position_m,
            attitude_t_p=quaternion(roll, pitch, units.rad_from_deg(start.heading_deg)),
            velocity_p_mps=start.velocity_mps if measured is None else tuple(measured.tolist()),
        )
