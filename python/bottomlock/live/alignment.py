"""Initial alignment of a live start: level and heading, by whom the file names, and the velocity."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.kernel.models import InitialState
from bottomlock.live.sections import StartSection
from bottomlock.recordings.levelling import level_from_force
from bottomlock.recordings.rotation import angles, matrix, quaternion

PING_AGE_NS = 1_000_000_000
"""Greatest age of the ping that gives the initial velocity."""
ATTITUDE_AGE_NS = 1_000_000_000
"""Greatest age of the attitude that gives a part of the initial one."""
SHORTEST_NS, SURELY = 10_000, 100
"""Interval of inertial readings that no instrument has, and of how many this is asked."""
GREATEST_MISFIT = 0.5
"""Of the mean specific force upwards over gravity from 1."""
Floats = NDArray[np.float64]


class Alignment:
    """Collects what a start needs; `state` gives it once everything is there.

    Args:
        start: the section.
        level_by_attitude: whether an attitude gives roll and pitch; else the accelerometers do.
        gravity_mps2: of the place; 0 where nothing measures it.
    """

    def __init__(
        self, start: StartSection, *, level_by_attitude: bool = False, gravity_mps2: float = 0.0
    ) -> None:
        self._start = start
        self._level_by_attitude = level_by_attitude
        self._gravity_mps2 = gravity_mps2
        self._window_ns = units.ns_from_s(start.window_s)
        self._readings: deque[tuple[int, Floats]] = deque()
        self._sum_mps2 = np.zeros(3)
        self._attitudes: deque[tuple[int, Floats]] = deque()
        self._velocity: tuple[int, Floats] | None = None
        self._depth_m: float | None = None

    def imu(self, time_ns: int, force_p_mps2: Floats) -> None:
        """Takes an inertial reading; one that does not follow the others begins a new window."""
        readings = self._readings
        if readings and not 0 < time_ns - readings[-1][0] <= self._window_ns:
            readings.clear()
            self._sum_mps2 = np.zeros(3)
        readings.append((time_ns, force_p_mps2))
        self._sum_mps2 = self._sum_mps2 + force_p_mps2
        while len(readings) > 2 and time_ns - readings[1][0] >= self._window_ns:
            self._sum_mps2 = self._sum_mps2 - readings.popleft()[1]

    def attitude(self, time_ns: int, attitude_t_p: Floats) -> None:
        """Takes an attitude of the platform (4,), quaternion, scalar first."""
        attitudes = self._attitudes
        attitudes.append((time_ns, attitude_t_p))
        while time_ns - attitudes[0][0] > ATTITUDE_AGE_NS:
            attitudes.popleft()

    def velocity(self, time_ns: int, velocity_p_mps: Floats) -> None:
        """Takes the velocity (3,) of a ping that determines the whole of it."""
        self._velocity = time_ns, velocity_p_mps

    def depth(self, depth_m: float) -> None:
        """Takes a depth, where the vehicle begins unless the section says where."""
        self._depth_m = depth_m

    @property
    def waiting_for(self) -> str:
        """What is still missing, in words; "" where nothing is."""
        return self._motion_waits_for or self._axes_wait_for or self._velocity_waits_for

    @property
    def _motion_waits_for(self) -> str:
        if not self._readings:
            return "inertial readings"
        span_ns = self._readings[-1][0] - self._readings[0][0]
        if span_ns < self._window_ns and not self._level_by_attitude:
            hint = ""
            if len(self._readings) > SURELY and span_ns < len(self._readings) * SHORTEST_NS:
                hint = f" after {len(self._readings)} inertial readings: are their times in ns?"
            return f"the alignment, {span_ns * 1e-9:.0f} of {self._start.window_s:g} s{hint}"
        needed = self._level_by_attitude or self._start.heading_deg is None
        return "an attitude" if needed and self._attitude() is None else ""

    @property
    def _axes_wait_for(self) -> str:
        """Accelerometers whose mean, turned by the attitude of the start, points up, and a tilt that may be."""
        if not self._gravity_mps2:
            return ""
        force = self._mean_force()
        attitude_t_p = np.array(self._attitude_t_p())
        up = -(matrix(attitude_t_p) @ force)[2] / self._gravity_mps2
        tilt_deg = np.degrees(np.arccos(np.clip(matrix(attitude_t_p)[2, 2], -1.0, 1.0)))
        words = f"({', '.join(f'{value:+.1f}' for value in force)}) m/s² along forward, starboard, down"
        if not 1.0 - GREATEST_MISFIT < np.linalg.norm(force) / self._gravity_mps2 < 1.0 + GREATEST_MISFIT:
            return (
                f"accelerometers that measure gravity: they read {words}, and (0, 0, -9.8) when level; are they in g, "
                "without gravity, or swapped with the rates?"
            )
        if tilt_deg > self._start.largest_tilt_deg:
            hint = (
                "z of the IMU is up (ROS): imu.mounting_roll_deg = 180"
                if force[2] > 0.5 * self._gravity_mps2
                else "imu.mounting_roll_deg, imu.mounting_pitch_deg"
            )
            return (
                f"a tilt below start.largest_tilt_deg = {self._start.largest_tilt_deg:g}: the accelerometers read "
                f"{words}, and (0, 0, -9.8) when level; {hint}?"
            )
        if not 1.0 - GREATEST_MISFIT < up < 1.0 + GREATEST_MISFIT:
            return (
                f"accelerometers that agree with the attitude: they read {words}, {up:.1f} g upwards by it; axes or "
                "units of the IMU, or mounting of [attitude]?"
            )
        return ""

    @property
    def _velocity_waits_for(self) -> str:
        if self._start.velocity == "beams" and self._velocity_at(self._time_ns) is None:
            return "a ping that determines the whole velocity"
        return ""

    @property
    def _time_ns(self) -> int:
        return self._readings[-1][0]

    def _velocity_at(self, time_ns: int) -> Floats | None:
        if self._velocity is None or abs(time_ns - self._velocity[0]) > PING_AGE_NS:
            return None
        return self._velocity[1]

    def _attitude(self) -> Floats | None:
        """The latest attitude that is not after the start, unless it is too old."""
        start_ns = self._time_ns
        known = [one for one in self._attitudes if 0 <= start_ns - one[0] <= ATTITUDE_AGE_NS]
        return max(known, key=lambda one: one[0])[1] if known else None

    def _attitude_t_p(self) -> tuple[float, ...]:
        """Initial attitude: roll and pitch, and heading, each by whom the file names."""
        heading_deg, known = self._start.heading_deg, self._attitude()
        roll, pitch, yaw = (0.0, 0.0, 0.0) if known is None else angles(known)
        if not self._level_by_attitude:
            roll, pitch = level_from_force(self._mean_force())
        elif known is not None and heading_deg is None:
            return tuple(known.tolist())
        return quaternion(roll, pitch, yaw if heading_deg is None else units.rad_from_deg(heading_deg))

    def _mean_force(self) -> Floats:
        return np.asarray(self._sum_mps2 / len(self._readings))

    @property
    def _position_m(self) -> tuple[float, float, float]:
        north, east, down = self._start.position_m
        if self._depth_m is None or "position_m" in self._start.model_fields_set:
            return north, east, down
        return north, east, self._depth_m

    def state(self) -> InitialState:
        """The state at the last reading, once `waiting_for` is empty."""
        start, time_ns = self._start, self._time_ns
        measured = self._velocity_at(time_ns) if start.velocity == "beams" else None
        return InitialState(
            time_ns=time_ns,
            position_t_m=self._position_m,
            attitude_t_p=self._attitude_t_p(),
            velocity_p_mps=start.velocity_mps if measured is None else tuple(measured.tolist()),
        )


class AttitudeAlignment(Alignment):
    """The same where attitudes take the place of inertial readings: the start is at the last of them."""

    def __init__(self, start: StartSection) -> None:
        super().__init__(start, level_by_attitude=True)

    @property
    def _motion_waits_for(self) -> str:
        return "" if self._attitudes else "an attitude"

    @property
    def _time_ns(self) -> int:
        return self._attitudes[-1][0]
