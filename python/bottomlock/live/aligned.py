"""A navigator that begins by itself: it aligns itself with what arrives, and takes every kind of reading."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bottomlock import units
from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.config.imu import without_gyrocompass
from bottomlock.io.beams import Instrument
from bottomlock.kernel import KernelError, Navigator, Report, VelocityFixes
from bottomlock.kernel.models import InitialState
from bottomlock.live.doubts import PINGS, closes
from bottomlock.live.estimator import solve_ping
from bottomlock.live.left_off import LeftOff
from bottomlock.live.navigator_config import KernelSettings, NavigatorConfig
from bottomlock.live.sections import ImuFromAttitude, StartSection
from bottomlock.recordings.attitude_motion import MotionFromAttitude
from bottomlock.recordings.readings import (
    AttitudeReading,
    DepthReading,
    ImuReading,
    Ping,
    Reading,
    SpeedReading,
    WaterReading,
)
from bottomlock.recordings.rotation import (
    QUATERNION_ENU_NED,
    QUATERNION_FLU_FRD,
    angles,
    level_from_force,
    matrix,
    product,
    quaternion,
)
from bottomlock.recordings.sensors import ATTITUDE, SENSOR_OF, SENSORS, WATER_TRACK, Sensor
from bottomlock.recordings.streams import Flags, Floats
from bottomlock.recordings.water_cells import CellCounts, water_beams

PING_AGE_NS = 1_000_000_000
"""Greatest age of the ping that gives the initial velocity."""
ATTITUDE_AGE_NS = 1_000_000_000
"""Greatest age of the attitude that gives a part of the initial one."""
CLOCKS_S = 60.0
"""Between a ping and the inertial readings: their clocks count from different times."""
SHORTEST_NS, SURELY = 10_000, 100
"""Interval of inertial readings that no instrument has, and of how many this is asked."""
GREATEST_MISFIT = 0.5
"""Of the mean specific force upwards over gravity from 1."""


class Alignment:
    """Collects what a start needs; `state` gives it once everything is there.

    Args:
        start: the section.
        level_by_attitude: whether an attitude gives roll and pitch; else the accelerometers do.
        gravity_mps2: of the place; 0 where nothing measures it.

    Attributes:
        depth_m: the last depth; None before the first.
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
        self.depth_m: float | None = None

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
        self.depth_m = depth_m

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
        if self._start.velocity != "beams" or self._velocity_at(self._time_ns) is not None:
            return ""
        words, apart_s = "a ping that determines the whole velocity", 0.0
        if self._velocity is not None:
            apart_s = (self._velocity[0] - self._time_ns) * 1e-9
        if abs(apart_s) > CLOCKS_S:
            words += (
                f": the last one is {apart_s:+.3g} s from the IMU's readings, do both count from one time?"
            )
        return words

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

    def state(self) -> InitialState:
        """The state at the last reading, once `waiting_for` is empty."""
        start, time_ns = self._start, self._time_ns
        measured = self._velocity_at(time_ns) if start.velocity == "beams" else None
        north, east, down = start.position_m
        if self.depth_m is not None and "position_m" not in start.model_fields_set:
            down = self.depth_m
        return InitialState(
            time_ns=time_ns,
            position_t_m=(north, east, down),
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


_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


class PlatformAttitude:
    """Attitudes of the platform: the sensor's, out of its frames and its mounting, with its yaw offset added."""

    def __init__(self, section: AttitudeReference) -> None:
        self._after = np.array(quaternion(*section.mounting_rpy_rad)) * _CONJUGATE
        self._before = np.array(quaternion(0.0, 0.0, units.rad_from_deg(section.yaw_offset_deg)))
        if section.frame == "enu_flu":
            self._after = product(QUATERNION_FLU_FRD, self._after)
            self._before = product(self._before, QUATERNION_ENU_NED)

    def of(self, reading: AttitudeReading) -> Floats:
        """(4,) quaternion, scalar first, platform to north-east-down."""
        return product(self._before, product(np.array(reading.attitude_t_s), self._after))


class AlignedNavigator:
    """A navigator that waits for its alignment, and is then given every reading with the sections' errors.

    Args:
        config: its sections.
        instrument: geometry and noise of the DVL.
        settings: what the kernel takes of the sections.
        longest_attitude_s: of attitudes in place of inertial readings: a longer interval is a gap.

    Attributes:
        navigator: None before the alignment.
        time_ns: of the last reading that moved it; None before the alignment.
        omega_p_radps: (3,) of the last inertial reading; None before the first.
        water_counts: what became of the cells of the water.
        imu_fault: why the last inertial reading of the alignment cannot be used; "" if it can.
    """

    def __init__(
        self,
        config: NavigatorConfig,
        instrument: Instrument,
        settings: KernelSettings,
        *,
        longest_attitude_s: float = 0.0,
    ) -> None:
        assert config.start is not None  # validated
        self._config, self._start = config, config.start
        self._instrument, self._settings = instrument, settings
        self._horizon_ns = units.ns_from_s(config.navigation.horizon_s)
        self._platform = None if config.attitude is None else PlatformAttitude(config.attitude)
        self._longest_attitude_s = longest_attitude_s
        self._motion: MotionFromAttitude | None = None
        self._left: LeftOff | None = None
        self._alignment = self._new_alignment()
        self._made: dict[type, Callable[[Any, Floats], SpeedReading]] = {}
        self._last_ns: int | None = None
        self._unclosed = 0
        """Complete pings in a row whose beams do not close."""
        self.navigator: Navigator | None = None
        self.time_ns: int | None = None
        self.omega_p_radps: Floats | None = None
        self.water_counts = CellCounts()
        self.imu_fault = ""

    @property
    def _turns(self) -> bool:
        """Whether attitudes take the place of inertial readings."""
        return isinstance(self._config.imu, ImuFromAttitude)

    @property
    def waiting_for(self) -> str:
        """What the start still lacks; "" once there is an estimate."""
        if self.navigator is not None:
            return ""
        if self.imu_fault:
            return f"inertial readings in range: {self.imu_fault}"
        return self._alignment.waiting_for or "the next inertial reading"

    def check_time(self, time_ns: int) -> None:
        """Checks the time of what moves the vehicle.

        Raises:
            KernelError: for one that is not later than those before.
        """
        if self._last_ns is not None and time_ns <= self._last_ns:
            raise KernelError(f"its time does not rise: {time_ns} ns, and the last was {self._last_ns} ns")
        if self.time_ns is not None and (time_ns < self.time_ns or (self._turns and time_ns == self.time_ns)):
            raise KernelError(
                f"it is older than the estimate: {time_ns} ns, and that is of {self.time_ns} ns"
            )

    def push(self, time_ns: int, reading: Reading) -> Sequence[Report]:
        """Takes a reading, at a time on the clock of all of them; nothing without a section for it.

        Before the alignment a depth says where the vehicle begins, and what aids otherwise is not taken.

        Raises:
            KernelError: for one that is older than the horizon, one that moves the vehicle as `check_time`, and an
                inertial reading that the kernel refuses, or the alignment.
        """
        if isinstance(reading, ImuReading):
            return self._imu(time_ns, reading)
        if isinstance(reading, AttitudeReading):
            return self._attitude(time_ns, reading)
        if self.navigator is not None:
            taken, made = replace(reading, time_ns=time_ns), self._made.get(type(reading))
            omega = np.zeros(3) if self.omega_p_radps is None else self.omega_p_radps
            pushed = taken if made is None else made(taken, omega)
            return self._push(self.navigator, SENSOR_OF[type(reading)], pushed)
        if isinstance(reading, DepthReading) and self._config.depth is not None:
            self._alignment.depth(reading.depth_m)
        return ()

    def _imu(self, time_ns: int, reading: ImuReading) -> Sequence[Report]:
        self.check_time(time_ns)
        axes = self._settings.imu_axes
        omega, force = axes @ np.array(reading.omega_radps), axes @ np.array(reading.force_mps2)
        if self.navigator is None:
            self._align(time_ns, omega, force)
            if self.navigator is None:
                return ()
        reports = self.navigator.push_imu(time_ns, omega_p_radps=omega, force_p_mps2=force)
        self._last_ns = self.time_ns = time_ns
        is_rejected = any(report.sensor == "imu" and report.verdict == "rejected" for report in reports)
        self.omega_p_radps = self.omega_p_radps if is_rejected else omega
        return reports

    def _align(self, time_ns: int, omega: Floats, force: Floats) -> None:
        """Takes a reading for the alignment; the navigator begins once that is complete."""
        options = self._settings.options
        for what, reading, scale, unit in (
            ("an angular rate", omega, options.imu_limits.max_rate_radps, "rad/s: are the rates in deg/s?"),
            ("a specific force", force, options.imu_limits.max_force_mps2, "m/s²: are the forces in mg?"),
        ):
            if not np.isfinite(reading).all():
                raise KernelError(f"a reading of the alignment has {what} that is not finite: {reading}")
            if np.abs(reading).max() >= scale:
                self.imu_fault = f"{what} beyond the full scale of {scale:.4g} {unit}"
                raise KernelError(f"a reading of the alignment has {self.imu_fault}")
        self.imu_fault = ""
        self._last_ns = time_ns
        self._alignment.imu(time_ns, force)
        if not self._alignment.waiting_for:
            self._start_navigator()

    def _attitude(self, time_ns: int, reading: AttitudeReading) -> Sequence[Report]:
        """Aiding, or in place of an inertial reading."""
        if self._platform is None:
            return ()
        attitude_t_p = self._platform.of(reading)
        if self._turns:
            return self._turn(time_ns, attitude_t_p)
        if self.navigator is None:
            self._alignment.attitude(time_ns, attitude_t_p)
            return ()
        w, x, y, z = attitude_t_p.tolist()
        return self._push(self.navigator, ATTITUDE, AttitudeReading(time_ns, (w, x, y, z)))

    def _push(self, navigator: Navigator, sensor: Sensor, reading: Any) -> Sequence[Report]:  # noqa: ANN401
        """The reports of a measurement; none where the configuration has no section for it."""
        section = getattr(self._config, sensor.name)
        return () if section is None else sensor.push(navigator, reading, section, self._config.home)

    def _turn(self, time_ns: int, attitude_t_p: Floats) -> Sequence[Report]:
        """Takes an attitude in place of an inertial reading."""
        self.check_time(time_ns)
        if self.navigator is None:
            self._last_ns = time_ns
            self._alignment.attitude(time_ns, attitude_t_p)
            if not self._alignment.waiting_for:
                self._motion = self._begun(self._alignment.state().velocity_p_mps, time_ns, attitude_t_p)
                self._start_navigator()
            return ()
        assert self._motion is not None  # since the navigator began
        block = self._motion.block(time_ns, attitude_t_p)
        reports = self.navigator.push_imu_block(**block)
        self._last_ns = self.time_ns = time_ns
        self.omega_p_radps = block["omega_p_radps"][-1]
        return reports

    def _begun(self, velocity_p_mps: ArrayLike, time_ns: int, attitude_t_p: Floats) -> MotionFromAttitude:
        """A motion that begins with a velocity and an attitude."""
        imu, origin = self._config.imu, self._config.origin
        assert isinstance(imu, ImuFromAttitude)
        assert origin is not None  # validated
        longest_s = max(imu.limits.max_gap_s, self._longest_attitude_s)
        latitude_rad = units.rad_from_deg(origin.latitude_deg)
        motion = MotionFromAttitude(latitude_rad, longest_interval_s=longest_s)
        motion.hold(velocity_p_mps)
        motion.block(time_ns, attitude_t_p)
        return motion

    def _new_alignment(self) -> Alignment:
        if self._turns:
            return AttitudeAlignment(self._start)
        return Alignment(
            self._start,
            level_by_attitude=self._config.level_by_attitude,
            gravity_mps2=self._settings.model.environment.gravity_mps2,
        )

    def _start_navigator(self) -> None:
        state, model, left = self._alignment.state(), self._settings.model, self._left
        if left is not None:
            depth_m, options = self._alignment.depth_m, self._settings.options
            state = left.state(state, depth_m)
            initial = left.initial(
                self._config.model_copy(update={"start": self._start}).initial(), state, self._config.attitude,
                depth_m=depth_m, turning_sd_radps=options.imu_limits.gap_rate_sd_radps,
            )  # fmt: skip
            model = model.replace(initial=initial)
        self._begin(
            Navigator(
                self._instrument.geometry,
                without_gyrocompass(model),
                self._settings.options,
                state,
                method=self._config.navigation.method,
                horizon_ns=self._horizon_ns,
            )
        )

    def _begin(self, navigator: Navigator) -> None:
        self._made = {
            sensor.reading: sensor.made(section)
            for sensor in SENSORS
            if sensor.made is not None and (section := getattr(self._config, sensor.name)) is not None
        }
        self.navigator = navigator
        self.time_ns = int(navigator.state()["time_ns"])

    def restart(self) -> None:
        """Gives the navigator up: a fresh alignment follows, of what is measured."""
        if self.navigator is not None:
            self._left = LeftOff.of(self.navigator)
            self._start = self._left.section(self._start, self._config.attitude)
        self.navigator = self.time_ns = None
        self._alignment = self._new_alignment()

    def continue_from(self, navigator: Navigator) -> None:
        """Goes on with a navigator that was saved; the readings since then are a gap, which it bridges."""
        self._begin(navigator)
        if self._turns:
            state = navigator.state()
            self._motion = self._begun(
                state["velocity_p_mps"], int(state["time_ns"]), np.asarray(state["attitude_t_p"])
            )

    def solve(self, time_ns: int, ping: Ping) -> VelocityFixes:
        """The velocity of a ping by itself, which the alignment waits for; noise as `NavigatorConfig.with_noise`.

        A ping whose beams disagree gives the alignment none, unless `PINGS` before it disagreed too: then their noise
        is not as claimed.
        """
        fixes = solve_ping(self._instrument.geometry, ping, "info")
        if int(fixes.rank[0]) == 3:
            if ping.valid.all():
                agree = closes(self._instrument.geometry, ping.velocity_mps, ping.sd_mps)
                self._unclosed = 0 if agree else self._unclosed + 1
            if not 0 < self._unclosed <= PINGS:
                self._alignment.velocity(time_ns, fixes.velocity_p_mps[0])
            if self._motion is not None:
                self._motion.hold(fixes.velocity_p_mps[0])
        return fixes

    def beams(self, time_ns: int, ping: Ping) -> Sequence[Report]:
        """Takes the beams of a ping, also one without a valid beam: the priors of the motion count from ping to ping.

        Raises:
            KernelError: for one that is older than the horizon.
        """
        if self.navigator is None:
            return ()
        return self.navigator.push_beams(time_ns, ping.velocity_mps, ping.valid, sd_mps=ping.sd_mps)

    def water(self, time_ns: int, ping: Ping) -> Iterator[tuple[int, Flags, Sequence[Report]]]:
        """Takes the cells of the water that came with a ping; yields time, valid beams and reports of each.

        Raises:
            KernelError: as `beams`.
        """
        section, navigator, instrument = self._config.water_track, self.navigator, self._instrument
        if section is None or ping.water is None or navigator is None:
            return
        rows, counts = water_beams(
            ping.water,
            instrument.geometry,
            section,
            beam_sd_mps=instrument.beam_sd_mps,
            bottom=(np.array([ping.time_ns]), ping.range_m[np.newaxis]),
        )
        self.water_counts += counts
        for row in np.flatnonzero(rows.valid.any(axis=1)):
            # Water of a record of its own was measured at another time than the bottom.
            at_ns = time_ns + int(rows.time_ns[row]) - ping.time_ns
            reading = WaterReading(
                at_ns, rows.velocity_mps[row], rows.valid[row], rows.sd_mps[row], float(rows.range_m[row])
            )
            yield at_ns, reading.valid, self._push(navigator, WATER_TRACK, reading)
