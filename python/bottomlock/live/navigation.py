"""The estimator of mode navigation: a `Navigator` fed with what arrives."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.attitude_motion import MotionFromAttitude
from bottomlock.kernel import KernelError, Navigator, VelocityFixes
from bottomlock.live.alignment import Alignment, AttitudeAlignment
from bottomlock.live.config import LiveConfig, kernel_settings
from bottomlock.live.estimator import LastPing, beams_of, solve_ping
from bottomlock.live.pings import Ping
from bottomlock.live.readings import AttitudeReading, DepthReading, ImuReading
from bottomlock.live.sections import ImuFromAttitude
from bottomlock.ports.estimate import Beams, Estimate, State
from bottomlock.ports.rotation import product, quaternion

_ACCEPTED = ("accepted", "accepted_in_part")
_BEAM_SENSORS = ("beams", "velocity")
"""The kernel's names of a DVL's measurements in its reports."""
_PENDING = 256

Floats = NDArray[np.float64]


@dataclass
class _Turning:
    """Attitudes in place of inertial readings: the sensor's axes and its declination, and the motion so far."""

    to_sensor: Floats
    declination: Floats
    new: Callable[[], MotionFromAttitude]

    def __post_init__(self) -> None:
        self.motion = self.new()

    @classmethod
    def of(cls, config: LiveConfig) -> "_Turning | None":
        """Of a configuration; None with inertial readings."""
        imu, origin = config.imu, config.origin
        if not isinstance(imu, ImuFromAttitude):
            return None
        assert origin is not None  # validated in LiveConfig
        turned = (imu.mounting_roll_deg, imu.mounting_pitch_deg, imu.mounting_yaw_deg)
        # A slow attitude is no gap.
        period_s = 1.0 / min(
            one.rate_hz for one in config.source if one.format in {"attitude-csv", "mavlink"}
        )
        longest_s = max(imu.limits.max_gap_s, config.states.silent_periods * period_s)
        latitude = units.rad_from_deg(origin.latitude_deg)
        return cls(
            to_sensor=np.array(quaternion(*map(units.rad_from_deg, turned))) * [1.0, -1.0, -1.0, -1.0],
            declination=np.array(quaternion(0.0, 0.0, units.rad_from_deg(imu.yaw_offset_deg))),
            new=partial(MotionFromAttitude, latitude, longest_interval_s=longest_s),
        )

    def of_platform(self, reading: AttitudeReading) -> Floats:
        """(4,) attitude of the platform."""
        return product(self.declination, product(np.array(reading.attitude_t_s), self.to_sensor))


class NavigationEstimator:
    """Mode navigation. See `live.estimator.Estimator`.

    A ping that arrives after the readings of its time of validity is put in its place, up to `navigation.horizon_s`. A
    reading that the navigator refuses (not one that it rejects, which is a value) ends it: a fresh alignment follows,
    and `resets` counts it.
    """

    def __init__(self, config: LiveConfig) -> None:
        self._instrument = config.instrument()
        self._settings = kernel_settings(config, self._instrument)
        assert config.start is not None  # validated in LiveConfig
        self._start, self._method, self._depth = config.start, config.navigation.method, config.depth
        self._horizon_ns = units.ns_from_s(config.navigation.horizon_s)
        self._navigator: Navigator | None = None
        self._turning = _Turning.of(config)
        self._alignment = self._new_alignment()
        self._time_ns: int | None = None
        self._omega: Floats | None = None
        self._pings: dict[int, tuple[Ping, VelocityFixes]] = {}
        self._fixes: VelocityFixes | None = None
        self._beams: Beams | None = None
        self._before_ns: int | None = None
        self._now_ns = 0
        self._last_imu_ns: int | None = None
        self.fault = ""
        self.rank = 0
        self.rejected = 0
        self.resets = 0
        self.ping_used_ns: int | None = None
        self.imu_used_ns: int | None = None
        self.last = LastPing(self._instrument.geometry.beams)

    @property
    def navigator(self) -> Navigator | None:
        """The navigator; None before the alignment."""
        return self._navigator

    @property
    def time_ns(self) -> int | None:
        """Time of the estimate; None without one."""
        return self._time_ns if self._navigator is not None else None

    @property
    def waiting_for(self) -> str:
        """What the start still lacks: the alignment, then a ping that fits."""
        if self._navigator is None:
            return self._alignment.waiting_for or "the next inertial reading"
        return "" if self.ping_used_ns is not None else "the first ping that is used"

    @property
    def velocity_sd_mps(self) -> float | None:
        """Largest 1 sigma of a velocity axis, m/s."""
        if self._navigator is None:
            return None
        return float(np.sqrt(np.diag(self._navigator.covariance())[6:9].max()))

    def imu(self, time_ns: int, reading: ImuReading, arrival_ns: int) -> None:
        """Takes an inertial reading.

        Raises:
            KernelError: for one that is not later than those before.
        """
        if self._last_imu_ns is not None and time_ns <= self._last_imu_ns:
            raise KernelError("its time does not rise")
        self._last_imu_ns, self._now_ns = time_ns, arrival_ns
        axes = self._settings.imu_axes
        omega, force = axes @ np.array(reading.omega_radps), axes @ np.array(reading.force_mps2)
        if self._navigator is None and not self._aligned(time_ns, omega, force):
            return
        assert self._navigator is not None
        if self._time_ns is not None and time_ns < self._time_ns:
            raise KernelError("it is older than the estimate")
        try:
            reports = self._navigator.push_imu(time_ns, omega_p_radps=omega, force_p_mps2=force)
        except KernelError:
            self.restart()
            raise
        self._time_ns, self._omega = time_ns, omega
        # A rejected reading is a value: it moves nothing, and does not count as one that was used.
        if not any(one["sensor"] == "imu" and one["verdict"] == "rejected" for one in reports):
            self.imu_used_ns = arrival_ns
        self._take(reports)

    def attitude(self, time_ns: int, reading: AttitudeReading, arrival_ns: int) -> None:
        """Takes an attitude in place of an inertial reading.

        Raises:
            KernelError: for one that is not later than those before.
        """
        turning = self._turning
        if turning is None:
            return
        if self._last_imu_ns is not None and time_ns <= self._last_imu_ns:
            raise KernelError("its time does not rise")
        if self._time_ns is not None and time_ns <= self._time_ns:
            raise KernelError("it is older than the estimate")
        self._last_imu_ns, self._now_ns = time_ns, arrival_ns
        attitude = turning.of_platform(reading)
        if self._navigator is None:
            self._turned(turning, time_ns, attitude)
            return
        block = turning.motion.block(time_ns, attitude)
        try:
            reports = self._navigator.push_imu_block(**block)
        except KernelError:
            self.restart()
            raise
        self._time_ns, self._omega = time_ns, block["omega_p_radps"][-1]
        if not any(one["sensor"] == "imu" and one["verdict"] == "rejected" for one in reports):
            self.imu_used_ns = arrival_ns
        self._take(reports)

    def _turned(self, turning: "_Turning", time_ns: int, attitude: Floats) -> None:
        """Takes an attitude for the alignment; the navigator begins once that is complete."""
        assert isinstance(self._alignment, AttitudeAlignment)
        self._alignment.attitude(time_ns, attitude)
        self.imu_used_ns = self._now_ns
        if not self._alignment.waiting_for:
            turning.motion = turning.new()
            turning.motion.hold(self._alignment.state().velocity_p_mps)
            turning.motion.block(time_ns, attitude)
            self._start_navigator()

    def _aligned(self, time_ns: int, omega: Floats, force: Floats) -> bool:
        """Takes a reading for the alignment; whether that is complete, and the navigator has begun."""
        options = self._settings.options
        if (
            np.abs(force).max() >= options.max_imu_force_mps2
            or np.abs(omega).max() >= options.max_imu_rate_radps
        ):
            raise KernelError("a reading of the alignment is beyond the full scale")
        self._alignment.imu(time_ns, force)
        self.imu_used_ns = self._now_ns
        if self._alignment.waiting_for:
            return False
        self._start_navigator()
        return True

    def _new_alignment(self) -> Alignment:
        return (Alignment if self._turning is None else AttitudeAlignment)(self._start)

    def _start_navigator(self) -> None:
        self._begin(
            Navigator(
                self._instrument.geometry,
                self._settings.model,
                self._settings.options,
                self._alignment.state(),
                method=self._method,
                horizon_ns=self._horizon_ns,
            )
        )

    def _begin(self, navigator: Navigator) -> None:
        self._navigator = navigator
        self._time_ns = int(navigator.state()["time_ns"])
        self._pings.clear()
        self.ping_used_ns = None

    def restart(self) -> None:
        """Gives the navigator up: a fresh alignment follows."""
        self._navigator, self._time_ns = None, None
        self._alignment = self._new_alignment()
        self._pings.clear()
        self._fixes, self.rank, self.rejected = None, 0, 0
        self.resets += 1

    def continue_from(self, navigator: Navigator) -> None:
        """Goes on with a navigator of a checkpoint; the readings since then are a gap, which it bridges."""
        self._begin(navigator)
        if self._turning is not None:
            state = navigator.state()
            self._turning.motion.hold(state["velocity_p_mps"])
            self._turning.motion.block(int(state["time_ns"]), state["attitude_t_p"])
        self.resets += 1

    def ping(self, time_ns: int, ping: Ping, arrival_ns: int) -> None:
        """Takes a ping.

        Raises:
            KernelError: for one that is older than the horizon.
        """
        self._now_ns = arrival_ns
        fixes = solve_ping(self._instrument, ping, "info")
        self.last.velocity_mps = np.where(ping.valid, ping.velocity_mps, np.nan)
        self.last.used = np.zeros_like(ping.valid)
        self.last.nis, self.last.verdict, self.last.why = None, "no valid beam", ""
        if int(fixes.rank[0]) == 3:
            self._alignment.velocity(time_ns, fixes.velocity_p_mps[0])
            if self._turning is not None:
                self._turning.motion.hold(fixes.velocity_p_mps[0])
        self._beams = beams_of(
            self._instrument, ping, offset_ns=time_ns - ping.time_ns, before_ns=self._before_ns
        )
        self._before_ns = ping.time_ns
        if self._navigator is None or not ping.valid.any():
            return
        self.last.verdict = "waits for inertial readings"
        self._pings[time_ns] = ping, fixes
        while len(self._pings) > _PENDING:
            del self._pings[next(iter(self._pings))]
        try:
            reports = self._navigator.push_beams(
                time_ns, ping.velocity_mps, ping.valid, sd_mps=self._instrument.beam_sd_mps
            )
        except KernelError:
            # No report will come of it.
            del self._pings[time_ns]
            raise
        self._take(reports)

    def _take(self, reports: Sequence[Any]) -> None:
        for report in reports:
            if report["sensor"] in _BEAM_SENSORS and report["time_ns"] in self._pings:
                self._judged(report, *self._pings.pop(report["time_ns"]))

    def _judged(self, report: Any, ping: Ping, fixes: VelocityFixes) -> None:  # noqa: ANN401
        """What the gate made of a ping."""
        verdict = report["verdict"]
        degrees = int(report["degrees"])
        self.last.nis = float(report["nis"]) / degrees if degrees else None
        self.last.verdict, self.last.why = verdict, report["reason"] or ""
        if verdict == "rejected":
            self.rejected += 1
            return
        if verdict not in _ACCEPTED:
            return
        self.rejected = 0
        used = ping.valid.copy()
        rows = np.asarray(report["rejected_rows"], dtype=bool)
        if rows.shape == (int(used.sum()),):
            used[np.flatnonzero(used)[rows]] = False
        weight = report["beam_weight"]
        if weight is not None:
            # A weight that is not a number is none: the beam was used.
            used &= ~(np.asarray(weight) <= 0.0)
        self.last.used = used
        if not self.last.why and bool((ping.valid & ~used).any()):
            self.last.why = "a beam that does not fit has no weight"
        self.rank, self._fixes, self.ping_used_ns = int(fixes.rank[0]), fixes, self._now_ns

    def depth(self, time_ns: int, reading: DepthReading) -> None:
        """Takes a depth.

        Raises:
            KernelError: for one that is older than the horizon.
        """
        if self._navigator is not None and self._depth is not None:
            self._take(self._navigator.push_depth(time_ns, reading.depth_m, sd_m=self._depth.sd_m))

    def estimate(self, state: State, reset_counter: int) -> Estimate | None:
        """The navigator's estimate as it is now; None before the alignment."""
        if self._navigator is None:
            return None
        # Without usable beams the last ping is the past: a port that passes beams on must not send it again.
        has_beams = state in {"OK", "PARTIAL"}
        return Estimate.from_navigator(
            self._navigator,
            state=state,
            reset_counter=reset_counter,
            fixes=self._fixes if has_beams else None,
            omega_p_radps=self._omega,
            beams=self._beams if has_beams else None,
        )
