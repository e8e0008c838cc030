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
        return self._velocity_at(self._readings[-1][0])

    def _velocity_at(self, time_ns: int) -> Floats | None:
        if self._velocity is None or abs(time_ns - self._velocity[0]) > PING_AGE_NS:
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
            attitude_t_p=quaternion(roll, pitch, units.rad_from_deg(start.heading_deg or 0.0)),
            velocity_p_mps=start.velocity_mps if measured is None else tuple(measured.tolist()),
        )


class AttitudeAlignment(Alignment):
    """The same where an attitude takes the place of inertial readings: it is the initial attitude."""

    def __init__(self, start: StartSection) -> None:
        super().__init__(start)
        self._latest: tuple[int, Floats] | None = None

    def attitude(self, time_ns: int, attitude_t_p: Floats) -> None:
        """Takes an attitude (4,), quaternion, scalar first."""
        self._latest = time_ns, attitude_t_p

    @property
    def waiting_for(self) -> str:
        """What is still missing, in words; "" where nothing is."""
        if self._latest is None:
            return "an attitude"
        if self._start.velocity == "beams" and self._velocity_at(self._latest[0]) is None:
            return "a ping that determines the whole velocity"
        return ""

    def state(self) -> InitialState:
        """The state at the last attitude, once `waiting_for` is empty."""
        assert self._latest is not None
        start, (time_ns, attitude) = self._start, self._latest
        measured = self._velocity_at(time_ns) if start.velocity == "beams" else None
        return InitialState(
            time_ns=time_ns,
            position_t_m=start.position_m,
            attitude_t_p=tuple(attitude.tolist()),
            velocity_p_mps=start.velocity_mps if measured is None else tuple(measured.tolist()),
        )
