"""Depth rate against the vertical velocity: the direction of z and the vertical scale."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.audit.logs import Reference
from bottomlock.audit.robust import LEAST_BLOCKS, Array, fit_linear
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
    inside = (time_ns >= depths.time_ns[0]) & (time_ns <= depths.time_ns[-1])
    if reference is not None:
        inside &= reference.spans(time_ns)
    at_ns, velocity = time_ns[inside], velocity_mps[inside]
    if len(at_ns) < 50:
        return None
    down = (velocity if reference is None else reference.at(at_ns).apply(velocity))[:, 2]
    time_s = (at_ns - at_ns[0]) * 1e-9
    steps = np.diff(time_s)
    path = np.concatenate([[0.0], np.cumsum(0.5 * (down[1:] + down[:-1]) * steps)])
    edges = np.searchsorted(time_s, np.arange(0.0, time_s[-1], WINDOW_S))
    # Over a gap of the log the velocity was not measured, and a straight line cuts off its peaks.
    longest = np.array([steps[a:b].max(initial=0.0) for a, b in itertools.pairwise(edges)])
    usable = (longest <= max(LONGEST_GAP_S, 2.5 * float(np.median(steps)))) & (
        np.diff(time_s[edges]) < 2.0 * WINDOW_S
    )
    moved = np.diff(path[edges])[usable]
    depth_m = np.interp(
        (at_ns[edges] - depths.time_ns[0]) * 1e-9, (depths.time_ns - depths.time_ns[0]) * 1e-9, depths.depth_m
    )
    sunk = np.diff(depth_m)[usable]
    if len(moved) < 20 or np.std(moved) < 1e-6:
        return None
    fit = fit_linear(np.stack([moved, np.ones_like(moved)], axis=1), sunk)
    return DepthRate(
        slope=float(fit.parameters[0]),
        slope_sd=float(np.std(fit.resampled[:, 0])) if fit.blocks >= LEAST_BLOCKS else np.inf,
        correlation=float(np.corrcoef(moved, sunk)[0, 1]) if np.ptp(sunk) > 0.0 else 0.0,
        rms_mps=float(rms(fit.residuals) / WINDOW_S),
        windows=len(moved),
        levelled=reference is not None,
        blocks=fit.blocks,
    )
