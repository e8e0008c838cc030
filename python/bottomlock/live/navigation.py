"""The estimator of mode navigation: a `Navigator` fed with what arrives."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bottomlock import units
from bottomlock.kernel import KernelError, Navigator, VelocityFixes
from bottomlock.kernel.attitude_motion import MotionFromAttitude
from bottomlock.kernel.models import MagnetometerModel
from bottomlock.live.aiding import push
from bottomlock.live.alignment import Alignment, AttitudeAlignment
from bottomlock.live.closure import Closure
from bottomlock.live.config import LiveConfig, kernel_settings
from bottomlock.live.estimator import LastPing, beams_of, solve_ping
from bottomlock.live.pings import Ping
from bottomlock.live.platform_attitude import PlatformAttitude
from bottomlock.live.readings import AidingReading, AttitudeReading, ImuReading
from bottomlock.live.reasons import Reasons
from bottomlock.live.sections import ImuFromAttitude
from bottomlock.ports.estimate import Beams, Estimate, State
from bottomlock.ports.rotation import angles
from bottomlock.recordings.streams import Flags, Floats
from bottomlock.recordings.water_cells import CellCounts, water_beams

_ACCEPTED = ("accepted", "accepted_in_part")
_BEAM_SENSORS = ("beams", "velocity")
"""The kernel's names of a DVL's measurements in its reports."""
EFFORT = ("effort_surge", "effort_sway", "effort_heave")
_AIDING = ("attitude", "heading", "depth", "gps_position", "acoustic_position", "thrust", *EFFORT)
"""The kernel's names of the other measurements."""
_PENDING = 256


def _motion_of_attitudes(config: LiveConfig) -> Callable[[], MotionFromAttitude] | None:
    """Makes the motion that takes the place of inertial readings; None where there are such."""
    imu, origin = config.imu, config.origin
    if not isinstance(imu, ImuFromAttitude):
        return None
    assert origin is not None  # validated in LiveConfig
    # A slow attitude is no gap.
    period_s = 1.0 / min(one.rate_hz for one in config.sources_of(config.motion_lines))
    longest_s = max(imu.limits.max_gap_s, config.states.silent_periods * period_s)
    return partial(MotionFromAttitude, units.rad_from_deg(origin.latitude_deg), longest_interval_s=longest_s)


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
        self._config, self._start, self._method = config, config.start, config.navigation.method
        self._horizon_ns = units.ns_from_s(config.navigation.horizon_s)
        self._navigator: Navigator | None = None
        self._attitude = config.attitude
        self._platform = None if config.attitude is None else PlatformAttitude(config.attitude)
        self._level_by_attitude = config.level_by_attitude
        self._new_motion = _motion_of_attitudes(config)
        self._motion = None if self._new_motion is None else self._new_motion()
        self._alignment = self._new_alignment()
        self._time_ns: int | None = None
        self._omega: Floats | None = None
        self._pings: dict[int, tuple[Ping, VelocityFixes]] = {}
        self._waters: dict[int, Flags] = {}
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
        self.water_used_ns: int | None = None
        self.last = LastPing(self._instrument.geometry.beams)
        self.gated = Reasons()
        self.water_counts = CellCounts()
        self.closure = Closure(self._instrument)
        self.imu_fault = ""

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
            if self.imu_fault:
                return f"inertial readings in range: {self.imu_fault}"
            return self._alignment.waiting_for or "the next inertial reading"
        return "" if self.ping_used_ns is not None else "the first ping that is used"

    @property
    def velocity_sd_mps(self) -> float | None:
        """Largest 1 sigma of a velocity axis, m/s."""
        if self._navigator is None:
            return None
        return float(np.sqrt(np.diag(self._navigator.covariance())[6:9].max()))

    @property
    def current(self) -> tuple[Floats, Floats] | None:
        """Current at the vehicle, north and east, and 1 sigma, m/s; None without water track."""
        if self._navigator is None or self._config.water_track is None:
            return None
        water = self._navigator.water()
        if water is None:
            return None
        return water["current_t_mps"], np.sqrt(np.diag(water["current_covariance"]))

    @property
    def reference_error(self) -> tuple[Floats, Floats] | None:
        """Slow error found of the aiding attitude (roll, pitch, yaw) or heading, and 1 sigma, rad; None without one."""
        if self._navigator is None or self._attitude is None or self._attitude.aids == "nothing":
            return None
        whole = self._attitude.aids == "attitude"
        found = self._navigator.attitude_error() if whole else self._navigator.heading_error()
        return None if found is None else (np.atleast_1d(found["error_rad"]), np.atleast_1d(found["sd_rad"]))

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
        self._note_motion(reports, arrival_ns)

    def _note_motion(self, reports: Sequence[Any], arrival_ns: int) -> None:
        """A rejected reading is a value: it moves nothing, and does not count as one that was used."""
        rejected = [one for one in reports if one["sensor"] == "imu" and one["verdict"] == "rejected"]
        self.imu_fault = (rejected[-1]["reason"] or "") if rejected else ""
        if not rejected:
            self.imu_used_ns = arrival_ns
        self._take(reports)

    def attitude(self, time_ns: int, reading: AttitudeReading, arrival_ns: int) -> None:
        """Takes an attitude: aiding, or in place of an inertial reading.

        Raises:
            KernelError: for one that is older than the horizon, or, in place of an inertial reading, one that is not
                later than those before.
        """
        if self._platform is None:
            return
        attitude_t_p = self._platform.of(reading)
        if self._motion is not None:
            self._turn(time_ns, attitude_t_p, arrival_ns)
        elif self._navigator is None:
            self._alignment.attitude(time_ns, attitude_t_p)
        else:
            self._take(self._aid(self._navigator, time_ns, attitude_t_p))

    def _aid(self, navigator: Navigator, time_ns: int, attitude_t_p: Floats) -> Sequence[Any]:
        """The reports of an attitude, or of its heading alone, as a measurement."""
        assert self._attitude is not None
        model = self._settings.model
        if self._attitude.aids == "attitude":
            noise = model.of(MagnetometerModel)
            return navigator.push_attitude(
                time_ns,
                attitude_t_p,
                roll_pitch_sd_rad=noise.roll_pitch_sd_rad,
                yaw_sd_rad=noise.yaw_sd_rad,
            )
        if self._attitude.aids == "heading":
            assert model.heading is not None
            return navigator.push_heading(time_ns, angles(attitude_t_p)[2], sd_rad=model.heading.sd_rad)
        return ()

    def _turn(self, time_ns: int, attitude_t_p: Floats, arrival_ns: int) -> None:
        """Takes an attitude in place of an inertial reading."""
        if self._last_imu_ns is not None and time_ns <= self._last_imu_ns:
            raise KernelError("its time does not rise")
        if self._time_ns is not None and time_ns <= self._time_ns:
            raise KernelError("it is older than the estimate")
        self._last_imu_ns, self._now_ns = time_ns, arrival_ns
        if self._navigator is None:
            self._start_turning(time_ns, attitude_t_p)
            return
        assert self._motion is not None
        block = self._motion.block(time_ns, attitude_t_p)
        try:
            reports = self._navigator.push_imu_block(**block)
        except KernelError:
            self.restart()
            raise
        self._time_ns, self._omega = time_ns, block["omega_p_radps"][-1]
        self._note_motion(reports, arrival_ns)

    def _start_turning(self, time_ns: int, attitude_t_p: Floats) -> None:
        """Takes an attitude for the alignment; the navigator begins once that is complete."""
        self._alignment.attitude(time_ns, attitude_t_p)
        self.imu_used_ns = self._now_ns
        if not self._alignment.waiting_for:
            assert self._new_motion is not None
            self._motion = self._new_motion()
            self._motion.hold(self._alignment.state().velocity_p_mps)
            self._motion.block(time_ns, attitude_t_p)
            self._start_navigator()

    def _aligned(self, time_ns: int, omega: Floats, force: Floats) -> bool:
        """Takes a reading for the alignment; whether that is complete, and the navigator has begun."""
        options = self._settings.options
        for what, reading, scale, unit in (
            ("angular rate", omega, options.max_imu_rate_radps, "rad/s: are the rates in deg/s?"),
            ("specific force", force, options.max_imu_force_mps2, "m/s²: are the forces in mg?"),
        ):
            if np.abs(reading).max() >= scale:
                self.imu_fault = f"{what} beyond the full scale of {scale:.4g} {unit}"
                raise KernelError(f"a reading of the alignment has an {self.imu_fault}")
        self.imu_fault = ""
        self._alignment.imu(time_ns, force)
        self.imu_used_ns = self._now_ns
        if self._alignment.waiting_for:
            return False
        self._start_navigator()
        return True

    def _new_alignment(self) -> Alignment:
        if self._motion is not None:
            return AttitudeAlignment(self._start)
        return Alignment(
            self._start,
            level_by_attitude=self._level_by_attitude,
            gravity_mps2=self._settings.model.environment.gravity_mps2,
        )

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
        self._forget_pings()
        self.ping_used_ns = self.water_used_ns = None

    def restart(self) -> None:
        """Gives the navigator up: a fresh alignment follows."""
        self._navigator, self._time_ns = None, None
        self._alignment = self._new_alignment()
        self._forget_pings()
        self._fixes, self.rank, self.rejected = None, 0, 0
        self.resets += 1

    def _forget_pings(self) -> None:
        self._pings.clear()
        self._waters.clear()

    def continue_from(self, navigator: Navigator) -> None:
        """Goes on with a navigator of a checkpoint; the readings since then are a gap, which it bridges."""
        self._begin(navigator)
        if self._motion is not None:
            state = navigator.state()
            self._motion.hold(state["velocity_p_mps"])
            self._motion.block(int(state["time_ns"]), state["attitude_t_p"])
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
        self.closure.add(ping.velocity_mps, ping.valid)
        if int(fixes.rank[0]) == 3:
            self._alignment.velocity(time_ns, fixes.velocity_p_mps[0])
            if self._motion is not None:
                self._motion.hold(fixes.velocity_p_mps[0])
        self._beams = beams_of(
            self._instrument, ping, offset_ns=time_ns - ping.time_ns, before_ns=self._before_ns
        )
        self._before_ns = ping.time_ns
        if self._navigator is None:
            return
        # One without a valid beam is an event, too: priors of the motion and the speed count from ping to ping.
        if ping.valid.any():
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
            self._pings.pop(time_ns, None)
            raise
        self._take(reports)
        self._water(self._navigator, time_ns, ping)

    def _water(self, navigator: Navigator, time_ns: int, ping: Ping) -> None:
        """Takes the cells of the water that came with a ping; `time_ns` is the ping's on our clock."""
        section = self._config.water_track
        if section is None or ping.water is None:
            return
        instrument = self._instrument
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
            self._waters[at_ns] = rows.valid[row]
            while len(self._waters) > _PENDING:
                del self._waters[next(iter(self._waters))]
            try:
                reports = navigator.push_water_track(
                    at_ns,
                    rows.velocity_mps[row],
                    rows.valid[row],
                    sd_mps=rows.sd_mps[row],
                    range_m=float(rows.range_m[row]),
                )
            except KernelError:
                self._waters.pop(at_ns, None)
                raise
            self._take(reports)

    def _judged_water(self, report: Any, valid: Flags) -> None:  # noqa: ANN401
        """What the gate made of a ping of the water."""
        if report["verdict"] not in _ACCEPTED:
            return
        used = np.flatnonzero(valid)
        rows = np.asarray(report["rejected_rows"], dtype=bool)
        if rows.shape == used.shape:
            used = used[~rows]
        if np.linalg.matrix_rank(np.asarray(self._instrument.geometry.directions_p)[used]) == 3:
            self.water_used_ns = self._now_ns

    def _take(self, reports: Sequence[Any]) -> None:
        for report in reports:
            if report["sensor"] in _BEAM_SENSORS and report["time_ns"] in self._pings:
                self._judged(report, *self._pings.pop(report["time_ns"]))
            elif report["sensor"] == "water_track" and report["time_ns"] in self._waters:
                self._judged_water(report, self._waters.pop(report["time_ns"]))
                if report["verdict"] == "rejected":
                    self.gated.add("water_track")
            # A revised report is of a measurement that was counted.
            elif report["verdict"] == "rejected" and report["sensor"] in _AIDING and not report["revised"]:
                self.gated.add(report["sensor"])

    def _judged(self, report: Any, ping: Ping, fixes: VelocityFixes) -> None:  # noqa: ANN401
        """What the gate made of a ping."""
        verdict = report["verdict"]
        degrees = int(report["degrees"])
        self.last.nis = float(report["nis"]) / degrees if degrees else None
        self.last.verdict, self.last.why = verdict, report["reason"] or ""
        if verdict == "rejected":
            self.rejected += 1
            self.rank = 0
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
        if (ping.valid & ~used).any():
            fixes = solve_ping(self._instrument, replace(ping, valid=used), "info")
        self.rank = int(fixes.rank[0])
        if self.rank:
            self._fixes, self.ping_used_ns = fixes, self._now_ns

    def aid(self, time_ns: int, reading: AidingReading) -> None:
        """Takes a measurement beside pings and attitudes.

        Raises:
            KernelError: for one that is older than the horizon.
        """
        if self._navigator is not None:
            self._take(push(self._navigator, self._config, time_ns, reading))

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
