"""Gyros against a recorded attitude: their unit, offset, its wander, and the noise of what they integrate to.

Both are compared over the same interval of time. What differs is the gyros' offset, their scale factor, turns between
two readings (aliasing) and the error of the attitude itself, so the noise found covers all of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from bottomlock.replay.motion.segments import LENGTH_S, integrate
from bottomlock.statistics.robust import sd_about_median

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SLOPE_S = 1.0
"""Increments over which the slope is taken: longer than jitter of the stamps, shorter than a wander of the offset."""
LONGEST_STEP_S = 0.5
"""An attitude that is recorded less often does not resolve the turns of a small vehicle."""
LEAST_SEGMENTS = 4
PARTS, SHORTEST_S = 8, 4.0
"""A short recording is cut into about so many segments, none shorter than so many seconds."""
LEAST_FOR_SCALE = 10
"""Segments from which a scale factor is told from a wander of the offset."""
LONGEST_LAG_S = 6.0
LAGS = (1, 2, 3, 4, 6)
"""Intervals between pings over which the noise is found."""


@dataclass(frozen=True, eq=False)
class GyroMatch:
    """Gyros against an attitude.

    Attributes:
        offset_radps, offset_sd_radps: (3,) mean difference, gyros minus attitude, and its 1 sigma.
        wander_radps_rts: random walk of the offset, RMS over the axes, rad/s/√s.
        noise_rad_rts: random walk of the integrated gyros, RMS over the axes, rad/√s.
        axes_rad_rts: (3,) the same of each axis.
        lag_s: the interval at which the noise was found.
    """

    offset_radps: Floats
    offset_sd_radps: Floats
    wander_radps_rts: float
    noise_rad_rts: float
    axes_rad_rts: Floats
    lag_s: float


def attitude_at(
    time_ns: Integers, attitude: Rotation, at_ns: Integers
) -> tuple[Rotation, NDArray[np.bool_]] | None:
    """Attitude at other times by interpolation, and where it is known: not beyond its ends or in a gap.

    Args:
        time_ns, attitude: (n,) rising.
        at_ns: (m,).
    """
    if len(time_ns) < 4:
        return None
    before = np.clip(np.searchsorted(time_ns, at_ns, side="right") - 1, 0, len(time_ns) - 2)
    known = (at_ns >= time_ns[0]) & (at_ns <= time_ns[-1])
    known &= np.diff(time_ns)[before] <= LONGEST_STEP_S * 1e9
    if known.sum() < 4:
        return None
    origin = int(time_ns[0])
    slerp = Slerp((time_ns - origin) * 1e-9, attitude)
    clipped = np.clip(at_ns, time_ns[0], time_ns[-1])
    return slerp((clipped - origin) * 1e-9), known


def slope(
    time_ns: Integers, omega_p: Floats, attitude_time_ns: Integers, attitude: Rotation
) -> tuple[float, float] | None:
    """Slope of the gyros' increments over those of the attitude, robust, and their correlation; None without overlap.

    Args:
        time_ns, omega_p: (n,), (n, 3) gyros in platform axes, in any unit: in rad/s the slope is 1.
        attitude_time_ns, attitude: (m,) of the platform, on the clock of the gyros.
    """
    found = attitude_at(attitude_time_ns, attitude, time_ns)
    if found is None:
        return None
    own, known = found
    steps_s = np.diff(time_ns) * 1e-9
    every = max(1, round(SLOPE_S / float(np.median(steps_s))))
    turned = np.vstack(
        [np.zeros(3), np.cumsum(0.5 * (omega_p[1:] + omega_p[:-1]) * steps_s[:, None], axis=0)]
    )
    first = np.arange(0, len(time_ns) - every, every)
    last = first + every
    unknown = np.concatenate([[0], np.cumsum(~known)])
    good = (unknown[last + 1] == unknown[first]) & (time_ns[last] - time_ns[first] < 2e9 * SLOPE_S + 1)
    first, last = first[good], last[good]
    if len(first) < 10:
        return None
    a = (own[first].inv() * own[last]).as_rotvec()
    b = turned[last] - turned[first]
    a, b = a - np.median(a, axis=0), b - np.median(b, axis=0)
    weight = np.ones(len(a))
    value = 0.0
    for _ in range(10):
        value = float((weight[:, None] * a * b).sum() / max(float((weight[:, None] * a * a).sum()), 1e-30))
        left = np.linalg.norm(b - value * a, axis=1)
        weight = 1.0 / np.maximum(1.0, left / max(2.0 * float(np.median(left)), 1e-30))
    w = weight[:, None]
    size = np.sqrt(float((w * a * a).sum()) * float((w * b * b).sum()))
    return value, float((w * a * b).sum()) / max(size, 1e-30)


def match_gyros(
    time_ns: Integers,
    omega_p_radps: Floats,
    attitude_time_ns: Integers,
    attitude: Rotation,
    interval_s: float,
) -> GyroMatch | None:
    """Offset, wander and noise of gyros; None with too few whole segments of both.

    Args:
        time_ns, omega_p_radps: (n,), (n, 3), platform axes.
        attitude_time_ns, attitude: (m,) of the platform, on the clock of the gyros.
        interval_s: between pings, over several of which the noise is found.
    """
    length_s = float(np.clip((time_ns[-1] - time_ns[0]) * 1e-9 / PARTS, SHORTEST_S, LENGTH_S))
    segments = integrate(time_ns, np.zeros_like(omega_p_radps), omega_p_radps, length_s=length_s)
    if segments is None:
        return None
    s, m = segments.time_ns.shape
    found = attitude_at(attitude_time_ns, attitude, segments.time_ns.ravel())
    if found is None:
        return None
    known = found[1].reshape(s, m).all(axis=1)
    if known.sum() < LEAST_SEGMENTS:
        return None
    own = found[0].as_matrix().reshape(s, m, 3, 3)[known]
    times = (segments.time_ns[known] - segments.time_ns[known][:, :1]) * 1e-9
    C, J = segments.rotation[known], segments.rotation_integral_s[known]
    # Gyros minus attitude, in the axes at the segment's beginning, where the offset adds ∫C dt times itself.
    beginning = np.swapaxes(own[:, :1], 2, 3)
    apart = Rotation.from_matrix((np.swapaxes(beginning @ own, 2, 3) @ C).reshape(-1, 3, 3))
    angle = np.einsum("smij,smj->smi", C, apart.as_rotvec().reshape(*C.shape[:2], 3))
    offsets = np.linalg.solve(J[:, -1], angle[:, -1][:, :, None])[:, :, 0]
    offset = np.median(offsets, axis=0)
    scatter = sd_about_median(offsets, axis=0)
    left = angle - np.einsum("smij,sj->smi", J, offsets)

    step_s = float(np.median(np.diff(times, axis=1)))
    lags = sorted({max(1, round(k * interval_s / step_s)) for k in LAGS if k * interval_s <= LONGEST_LAG_S})
    lags = [lag for lag in lags if lag <= m // 3] or [1]
    densities = []
    for lag in lags:
        moved = np.einsum("smji,smj->smi", C[:, :-lag], left[:, lag:] - left[:, :-lag]).reshape(-1, 3)
        densities.append(sd_about_median(moved, axis=0) / np.sqrt(lag * step_s))
    size = [float(np.sqrt(np.mean(one**2))) for one in densities]
    worst = int(np.argmax(size))
    # What follows the rate of turn is a scale factor, which does not wander.
    rate = segments.omega_p_radps[known].mean(axis=1)
    turning = (rate - rate.mean(axis=0)) * (len(rate) >= LEAST_FOR_SCALE)
    follows = (turning * offsets).sum(axis=0) / np.maximum((turning**2).sum(axis=0), 1e-30)
    steady = offsets - turning * follows
    # A walk grows with time; errors of one segment, those of the attitude among them, do not.
    far = max(2, len(steady) // 3)
    near_sd, far_sd = (sd_about_median(steady[k:] - steady[:-k], axis=0) for k in (1, far))
    apart_s = (far - 1) * float(np.median(np.diff(segments.time_ns[known][:, 0]))) * 1e-9
    wander = np.maximum(far_sd**2 - near_sd**2, 0.0) / apart_s
    return GyroMatch(
        offset, scatter / np.sqrt(len(offsets)), float(np.sqrt(np.mean(wander))), size[worst], densities[worst],
        lags[worst] * step_s,
    )  # fmt: skip
