"""Sway through the water as complete pings measured it, against what the method `sway_current` assumes of it."""

from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.case import Case
from bottomlock.replay.findings.limits import SLIP_FACTOR
from bottomlock.replay.reckon import whole_velocities
from bottomlock.replay.rerun import PreparedRun

FEWEST = 100
"""Complete pings from which the sway is known."""


@dataclass(frozen=True)
class Sway:
    """Sway that is neither current, nor trim, nor a share of the yaw rate.

    Attributes:
        rms_mps: its RMS, without what is white from ping to ping.
        time_s: lag at which its autocorrelation is below 1/e.
        white_mps: what is white from ping to ping: noise of the beams.
        surge_mps: RMS of the surge.
        assumed_mps, assumed_s: 1 sigma and time of the slip that `sway_current` assumes.
    """

    rms_mps: float
    time_s: float
    white_mps: float
    surge_mps: float
    assumed_mps: float
    assumed_s: float

    @property
    def fits(self) -> bool:
        """Whether the assumption of `sway_current` holds."""
        return self.rms_mps <= SLIP_FACTOR * self.assumed_mps

    def words(self) -> str:
        """What was measured, and which method it leads to."""
        surge = f"surge is {self.surge_mps:.2g} m/s RMS"
        assumed = f"sway_current assumes {self.assumed_mps:.2g} m/s for {self.assumed_s:.2g} s"
        if self.rms_mps == 0.0:
            return (
                f"Complete pings show no sway of the vehicle's own, only noise of {self.white_mps:.2g} m/s from "
                f"ping to ping; {surge}, {assumed}: it fits this vehicle."
            )
        measured = (
            f"Sway of complete pings, without current and turns: {self.rms_mps:.2g} m/s RMS for {self.time_s:.2g} s; "
            f"{surge}, {assumed}"
        )
        if self.fits:
            return f"{measured}: it fits this vehicle."
        return (
            f"{measured}: it does not fit this vehicle. Set filter.water.vehicle (hovering, surface), or slip_sd_mps "
            f"= {self.rms_mps:.2g} and slip_time_s = {self.time_s:.2g}; or take tc."
        )


def measured_sway(case: Case, prepared: PreparedRun, time_ns: Times, yaw_rad: Floats) -> Sway | None:
    """The sway of the pings that have every beam; None for too few of them.

    Args:
        case: the case.
        prepared: its start and settings.
        time_ns, yaw_rad: (T,) heading, recorded or of a method.
    """
    full = prepared.streams.beams.valid[prepared.pings]
    whole = whole_velocities(prepared, full & full.all(axis=1, keepdims=True))
    if len(whole.time_ns) < FEWEST:
        return None
    surge, sway = whole.velocity_p_mps[:, 0], whole.velocity_p_mps[:, 1]
    yaw = np.interp(whole.time_ns, time_ns, np.unwrap(yaw_rad))
    rate = np.gradient(yaw, whole.time_ns * 1e-9)
    ones = np.ones(len(sway))
    columns = np.stack([-np.sin(yaw), np.cos(yaw), ones, -rate], axis=1)
    water = case.filter.water
    prior = np.array([water.current_sd_mps] * 2 + [water.trim_sd_mps, water.sway_gain_sd_m])
    centred = sway - columns[:, 3] * water.sway_gain_m
    spread = max(float(np.var(centred)), 1e-12)
    # What is fitted is bounded by its prior, so that a straight leg does not turn its slip into a current.
    normal = columns.T @ columns / spread + np.diag(1.0 / np.maximum(prior, 1e-9) ** 2)
    found = np.linalg.solve(normal, columns.T @ centred / spread)
    slip = centred - columns @ found
    var, time_s = _own(slip, float(np.median(np.diff(whole.time_ns))) * 1e-9)
    return Sway(
        rms_mps=float(np.sqrt(var)),
        time_s=time_s,
        white_mps=float(np.sqrt(max(float(np.mean(slip**2)) - var, 0.0))),
        surge_mps=float(np.sqrt(np.mean(surge**2))),
        assumed_mps=water.slip_sd_mps,
        assumed_s=water.slip_time_s,
    )


def _own(slip: Floats, step_s: float) -> tuple[float, float]:
    """Variance that lasts beyond a ping, and the lag at which its autocorrelation is below 1/e.

    White noise is in the autocorrelation at lag zero alone: what is left there is the line through lags one and two. It
    counts where it is beyond the scatter of an autocorrelation of white noise, three in the root of the pings.
    """
    count = len(slip)
    spectrum = np.fft.rfft(slip, 2 * count)
    acf = np.fft.irfft(np.abs(spectrum) ** 2)[: count // 2] / count
    var = float(min(acf[0], 2.0 * acf[1] - acf[2]))
    if acf[1] < 3.0 * acf[0] / np.sqrt(count) or var <= 0.0:
        return 0.0, 0.0
    below = np.flatnonzero(acf[1:] < var / np.e)
    return var, float(step_s * (1 + below[0] if below.size else count // 2))
