"""Depth rate against the vertical velocity: the direction of z and the vertical scale."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from bottomlock.audit.logs import Reference
from bottomlock.audit.robust import LEAST_BLOCKS, Array, fit_linear, sigmas_for
from bottomlock.recordings.finding import Finding
from bottomlock.recordings.streams import Depths
from bottomlock.statistics.rms import rms

WINDOW_S = 5.0
LONGEST_GAP_S = 1.0
"""Between two velocities of a window: of an oscillation of 6 s a straight line over 1 s loses 9 % at the peak."""


@dataclass(frozen=True)
class DepthRate:
    """Change of depth = slope × integrated downward velocity over windows; `levelled` where an attitude was used."""

    slope: float
    slope_sd: float
    correlation: float
    rms_mps: float
    windows: int
    levelled: bool
    blocks: int


def depth_rate(
    time_ns: NDArray[np.int64], velocity_mps: Array, depths: Depths, reference: Reference | None
) -> DepthRate | None:
    """Slope of the depth change on the integrated downward part of velocities (n, 3), m/s, at times (n,), ns.

    With an attitude the velocity is rotated to the tangent frame; without, z is taken as down, and pitch × surge adds
    an error. Returns None where the recordings overlap too little or the vehicle hardly moves vertically.
    """
    time_s = time_ns * 1e-9
    depth_s = depths.time_ns * 1e-9
    inside = (time_s >= depth_s[0]) & (time_s <= depth_s[-1])
    if reference is not None:
        own = reference.time_ns * 1e-9
        inside &= (time_s >= own[0]) & (time_s <= own[-1])
    time_s, velocity = time_s[inside], velocity_mps[inside]
    if len(time_s) < 50:
        return None
    down = velocity[:, 2]
    if reference is not None:
        attitude = Slerp(reference.time_ns * 1e-9, Rotation.from_euler("ZYX", reference.rpy_rad[:, ::-1]))
        down = attitude(time_s).apply(velocity)[:, 2]
    path = np.concatenate([[0.0], np.cumsum(0.5 * (down[1:] + down[:-1]) * np.diff(time_s))])
    edges = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], WINDOW_S))
    # Over a gap of the log the velocity was not measured, and a straight line cuts off its peaks.
    steps = np.diff(time_s)
    longest = np.array([steps[a:b].max(initial=0.0) for a, b in itertools.pairwise(edges)])
    usable = (longest <= max(LONGEST_GAP_S, 2.5 * float(np.median(steps)))) & (
        np.diff(time_s[edges]) < 2.0 * WINDOW_S
    )
    moved = np.diff(path[edges])[usable]
    sunk = np.diff(np.interp(time_s[edges], depth_s, depths.depth_m))[usable]
    if len(moved) < 20 or np.std(moved) < 1e-6:
        return None
    fit = fit_linear(np.stack([moved, np.ones_like(moved)], axis=1), sunk)
    return DepthRate(
        slope=float(fit.parameters[0]),
        slope_sd=float(np.std(fit.resampled[:, 0])) if fit.blocks >= LEAST_BLOCKS else np.inf,
        correlation=float(np.corrcoef(moved, sunk)[0, 1]),
        rms_mps=float(rms(fit.residuals) / WINDOW_S),
        windows=len(moved),
        levelled=reference is not None,
        blocks=fit.blocks,
    )


def depth_findings(rate: DepthRate | None) -> list[Finding]:
    """A z axis that points up, or a wrong vertical scale."""
    if rate is None:
        return []
    caveat = (
        "" if rate.levelled else " Without an attitude, pitch times surge is included and biases the slope."
    )
    sd = (
        f"± {rate.slope_sd:.2g}"
        if np.isfinite(rate.slope_sd)
        else f"(too few independent windows, {rate.blocks})"
    )
    evidence = (
        f"Slope {rate.slope:+.2f} {sd}, correlation {rate.correlation:+.2f} over {rate.windows} "
        f"windows of {WINDOW_S:g} s.{caveat}"
    )
    if abs(rate.correlation) < 0.3 or abs(rate.slope) < sigmas_for(rate.blocks) * rate.slope_sd:
        return [
            Finding(
                "depth_not_observable", "note", 0.0,
                "Neither the sign of z nor the vertical scale is observable in this log: the depth hardly correlates "
                "with the vertical velocity.",
                evidence,
                "Record a descent or an ascent.",
                size=rate.slope,
            )
        ]  # fmt: skip
    if rate.slope < 0.0:
        return [
            Finding(
                "z_points_up", "fault", 1.0,
                "The z axis of the velocity points up: the depth increases when z is negative.",
                evidence,
                "Rotate the velocity to forward, right, down before using it.",
                size=rate.slope,
            )
        ]  # fmt: skip
    if rate.levelled and abs(rate.slope - 1.0) > max(0.03, sigmas_for(rate.blocks) * rate.slope_sd):
        return [
            Finding(
                "vertical_scale", "warning", min(abs(rate.slope - 1.0), 1.0),
                f"The depth changes {rate.slope:.3f} times as fast as the integrated vertical velocity.",
                evidence,
                "Check the tilt of the beams and the sound speed.",
                size=100.0 * (rate.slope - 1.0), unit="%",
            )
        ]  # fmt: skip
    return []
