"""The estimator of mode navigation: a `Navigator` fed with what arrives."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from bottomlock.kernel import KernelError, Navigator, Report, VelocityFixes
from bottomlock.live.aligned import AlignedNavigator
from bottomlock.live.config import LiveConfig
from bottomlock.live.doubts import ACCEPTED, BEAM_SENSORS
from bottomlock.live.estimator import Estimator, LastPing, on_host_clock, solve_ping
from bottomlock.live.navigator_config import kernel_settings
from bottomlock.ports.estimate import Estimate, State
from bottomlock.recordings.readings import Ping, Reading
from bottomlock.recordings.streams import Flags

T = TypeVar("T")

_PENDING = 256


def _wait(waiting: dict[int, T], time_ns: int, what: T) -> None:
    """Keeps what was pushed until its report comes; of too many the last."""
    waiting[time_ns] = what
    while len(waiting) > _PENDING:
        del waiting[next(iter(waiting))]


class NavigationEstimator(Estimator):
    """Mode navigation.

    A ping that arrives after the readings of its time of validity is put in its place, up to `navigation.horizon_s`. A
    reading that the navigator refuses (not one that it rejects, which is a value) ends it: a fresh alignment follows,
    and `resets` counts it.
    """

    def __init__(self, config: LiveConfig) -> None:
        super().__init__(config)
        self._attitude = config.attitude
        # A slow attitude in place of inertial readings is no gap.
        period_s = 1.0 / min(one.rate_hz for one in config.sources_of(config.motion))
        self._aligned = AlignedNavigator(
            config,
            self._instrument,
            kernel_settings(config, self._instrument),
            longest_attitude_s=config.states.silent_periods * period_s,
        )
        self._pings: dict[int, tuple[Ping, VelocityFixes]] = {}
        self._waters: dict[int, Flags] = {}
        self._now_ns = 0
        self._rejected_reading = ""

    @property
    def navigator(self) -> Navigator | None:
        """The navigator; None before the alignment."""
        return self._aligned.navigator

    @property
    def time_ns(self) -> int | None:
        """Time of the estimate; None without one."""
        return self._aligned.time_ns

    @property
    def imu_fault(self) -> str:
        """Why the last inertial reading was rejected; "" if it was not."""
        return self._aligned.imu_fault or self._rejected_reading

    @property
    def waiting_for(self) -> str:
        """What the start still lacks: the alignment, then a ping that fits."""
        waits = self._aligned.waiting_for
        return waits or ("" if self.ping_used_ns is not None else "the first ping that is used")

    @property
    def velocity_sd_mps(self) -> float | None:
        """Largest 1 sigma of a velocity axis, m/s."""
        if self.navigator is None:
            return None
        return float(np.sqrt(np.diag(self.navigator.covariance())[6:9].max()))

    def known(self) -> dict[str, Any]:
        """As `Estimator.known`."""
        navigator, section = self.navigator, self._attitude
        reference: dict[str, dict[str, float]] = {}
        if navigator is None:
            return super().known()
        if section is not None and section.aids != "nothing":
            whole = section.aids == "attitude"
            found = navigator.attitude_error() if whole else navigator.heading_error()
            if found is not None:
                error, sd = (np.atleast_1d(found[key]).tolist() for key in ("error_rad", "sd_rad"))
                names = ("roll", "pitch", "yaw")[-len(sd) :]
                each = zip(names, error, sd, strict=True)
                reference = {name: {"error_rad": value, "sd_rad": one} for name, value, one in each}
        water = None if self._config.water_track is None else navigator.water()
        if water is None:
            return {"reference": reference, "water": None}
        shown = {
            "current_mps": water["current_t_mps"].tolist(),
            "current_sd_mps": np.sqrt(np.diag(water["current_covariance"])).tolist(),
            "cells": self._aligned.water_counts.text(),
        }
        return {"reference": reference, "water": shown}

    def take(self, time_ns: int, reading: Ping | Reading, arrival_ns: int) -> None:
        """Takes a ping or a reading; one that moves the vehicle and is refused ends the navigator.

        A rejected reading is a value: it moves nothing, and does not count as one that was used.
        """
        if isinstance(reading, Ping):
            self._ping(time_ns, reading, arrival_ns)
            return
        if not isinstance(reading, self._config.moved_by):
            self._take(self._aligned.push(time_ns, reading))
            return
        self._aligned.check_time(time_ns)
        self._now_ns, before = arrival_ns, self.navigator
        try:
            reports = self._aligned.push(time_ns, reading)
        except KernelError:
            if before is not None:
                self.restart()
            raise
        if before is None and self.navigator is not None:
            self._forget()
        rejected = [one for one in reports if one.sensor == "imu" and one.verdict == "rejected"]
        self._rejected_reading = (rejected[-1].reason or "") if rejected else ""
        if not rejected:
            self.imu_used_ns = self._now_ns
        self._take(reports)

    def restart(self) -> None:
        """Gives the navigator up: a fresh alignment follows."""
        self._aligned.restart()
        self._pings.clear()
        self._waters.clear()
        self._fixes, self.rank = None, 0
        self.doubts.forget()
        self.resets += 1

    def _forget(self) -> None:
        """Of a navigator before."""
        self._pings.clear()
        self._waters.clear()
        self.doubts.forget()
        self.ping_used_ns = self.water_used_ns = None

    def continue_from(self, navigator: Navigator) -> None:
        """Goes on with a navigator of a checkpoint; the readings since then are a gap, which it bridges."""
        self._aligned.continue_from(navigator)
        self._forget()
        self.resets += 1

    def _ping(self, time_ns: int, ping: Ping, arrival_ns: int) -> None:
        ping = self._config.with_noise(ping, self._instrument)
        self._now_ns = arrival_ns
        fixes = self._aligned.solve(time_ns, ping)
        velocity_mps = np.where(ping.valid, ping.velocity_mps, np.nan)
        self.last = LastPing(velocity_mps, np.zeros_like(ping.valid), "no valid beam")
        self.doubts.ping(ping)
        self._beams = on_host_clock(ping, time_ns)
        if self.navigator is None:
            return
        if ping.valid.any():
            self.last.verdict = "waits for inertial readings"
        reports = self._aligned.beams(time_ns, ping)
        if ping.valid.any():
            _wait(self._pings, time_ns, (ping, fixes))
        self._take(reports)
        for at_ns, valid, found in self._aligned.water(time_ns, ping):
            _wait(self._waters, at_ns, valid)
            self._take(found)

    def _judged_water(self, report: Report, valid: Flags) -> None:
        """What the gate made of a ping of the water."""
        if report.verdict not in ACCEPTED:
            return
        used = np.flatnonzero(valid)
        rows = np.asarray(report.rejected_rows, dtype=bool)
        if rows.shape == used.shape:
            used = used[~rows]
        if np.linalg.matrix_rank(np.asarray(self._instrument.geometry.directions_p)[used]) == 3:
            self.water_used_ns = self._now_ns

    def _take(self, reports: Sequence[Report]) -> None:
        for report in reports:
            self.doubts.take(report)
            if report.sensor in BEAM_SENSORS and report.time_ns in self._pings:
                self._judged(report, *self._pings.pop(report.time_ns))
            elif report.sensor == "water_track" and report.time_ns in self._waters:
                self._judged_water(report, self._waters.pop(report.time_ns))

    def _judged(self, report: Report, ping: Ping, fixes: VelocityFixes) -> None:
        """What the gate made of a ping."""
        verdict = report.verdict
        degrees = int(report.degrees)
        self.last.nis = float(report.nis) / degrees if degrees else None
        self.last.verdict, self.last.why = verdict, report.reason or ""
        if verdict == "rejected":
            self.rank = 0
        if verdict not in ACCEPTED:
            return
        used = ping.valid.copy()
        rows = np.asarray(report.rejected_rows, dtype=bool)
        if rows.shape == (int(used.sum()),):
            used[np.flatnonzero(used)[rows]] = False
        weight = report.beam_weight
        if weight is not None:
            # A weight that is not a number is none: the beam was used.
            used &= ~(np.asarray(weight) <= 0.0)
        self.last.used = used
        if not self.last.why and bool((ping.valid & ~used).any()):
            self.last.why = "a beam that does not fit has no weight"
        if (ping.valid & ~used).any():
            fixes = solve_ping(self._instrument.geometry, replace(ping, valid=used), "info")
        self.rank = int(fixes.rank[0])
        if self.rank:
            self._fixes, self.ping_used_ns = fixes, self._now_ns

    def estimate(self, state: State, reset_counter: int) -> Estimate | None:
        """The navigator's estimate as it is now; None before the alignment."""
        if self.navigator is None:
            return None
        # Without usable beams the last ping is the past: a port that passes beams on must not send it again.
        has_beams = state in {"OK", "PARTIAL"}
        return Estimate.from_navigator(
            self.navigator,
            state=state,
            reset_counter=reset_counter,
            fixes=self._fixes if has_beams else None,
            omega_p_radps=self._aligned.omega_p_radps,
            beams=self._beams if has_beams else None,
        )
