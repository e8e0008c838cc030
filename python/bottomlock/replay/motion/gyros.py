"""Gyros against a recorded attitude: their unit, offset, its wander, and the noise of what they integrate to.

Both are compared over the same interval of time. What differs is the gyros' offset, their scale factor, turns between
two readings (aliasing) and the error of the attitude itself, so the noise found covers all of them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.noise_growth import Walk, noise_growth
from bottomlock.recordings.rig_motion import LENGTH_S, integrate
from bottomlock.recordings.robust import sd_about_median
from bottomlock.recordings.streams import Attitudes, Flags, Floats, Inertial, Integers, integrals
from bottomlock.replay.read_tables import OMEGA_SI

SLOPE_S = 1.0
"""Increments over which the slope is taken: longer than jitter of the stamps, shorter than a wander of the offset."""
LONGEST_STEP_S = 0.5
"""An attitude that is recorded less often does not resolve the turns of a small vehicle, and is not interpolated."""
SLOWEST_STEP_S = 5.0
"""An attitude that is recorded less often than this is not compared with gyros at all."""
COVERED = 0.7
LEAST_PAIRS, LEAST_STEPS = 20, 10
OUTLIER = 4.0
RESOLVED = 2.0
"""Sigmas from which a wander of the offset is told from the errors of single segments."""
LEAST_SEGMENTS = 4
PARTS, SHORTEST_S = 8, 4.0
"""A short recording is cut into about so many segments, none shorter than so many seconds."""
LEAST_FOR_SCALE = 10
"""Segments from which a scale factor is told from a wander of the offset."""
LONGEST_LAG_S = 6.0
LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24)
"""Intervals between pings over which the noise is found."""


@dataclass(frozen=True, eq=False)
class GyroMatch:
    """Gyros against an attitude.

    Attributes:
        offset_radps, offset_sd_radps: (3,) mean difference, gyros minus attitude, and its 1 sigma.
        wander_radps_rts: random walk of the offset, RMS over the axes, rad/s/√s.
        noise: random walk of the integrated gyros, RMS over the axes, rad/√s; None with too few intervals.
        lag_s: the longest interval at which the noise was found.
        white_rad: (3,) white noise of the attitude about forward, right and down of the platform; 0 where none shows.
    """

    offset_radps: Floats
    offset_sd_radps: Floats
    wander_radps_rts: float
    noise: Walk | None
    lag_s: float
    white_rad: Floats


def attitude_at(
    time_ns: Integers, attitude: Rotation, at_ns: Integers, longest_step_s: float = LONGEST_STEP_S
) -> tuple[Rotation, Flags] | None:
    """Attitude at other times by interpolation, and where it is known: not beyond its ends or in a gap.

    Args:
        time_ns, attitude: (n,) rising.
        at_ns: (m,).
        longest_step_s: longer ones are gaps.
    """
    if len(time_ns) < 4:
        return None
    before = np.clip(np.searchsorted(time_ns, at_ns, side="right") - 1, 0, len(time_ns) - 2)
    known = (at_ns >= time_ns[0]) & (at_ns <= time_ns[-1])
    known &= np.diff(time_ns)[before] <= longest_step_s * 1e9
    if known.sum() < 4:
        return None
    return Attitudes(time_ns, attitude).at(at_ns), known


SURE, CORRELATED = 0.7, 0.6
"""Correlation of one-second turns from which their slope tells the unit, and from which both are of one vehicle."""
NEAR = 2.0
"""A unit is told by a slope within this factor."""
LEVEL_S = 10.0
"""Interval over which the direction of gravity is compared."""


@dataclass(frozen=True, eq=False)
class GyroFit:
    """Gyros and accelerometers against a recorded attitude, as a first case and its findings read it.

    Attributes:
        steps: number of steps of a second.
        slope, slope_sd: of the gyros over the attitude, which is 1 in the right unit, robust, and its 1 sigma.
        correlation: of both.
        rotation: from the attitude's axes to those of the IMU, by turns and level.
        left: part of the misfit of turns and level that is left with that rotation.
        misfit: squares of what the turns differ by over those of what is left by the slope.
    """

    steps: int
    slope: float
    slope_sd: float
    correlation: float
    rotation: Rotation
    left: float
    misfit: float

    @property
    def one_vehicle(self) -> bool:
        """Whether both turn alike."""
        return self.correlation >= CORRELATED

    def unit(self, stated: str) -> tuple[str, float] | None:
        """The unit that the slope tells, and the slope in it; None where it tells none.

        Args:
            stated: in which the gyros were read.
        """
        if not self.slope > 0.0:
            return None
        slopes = {unit: self.slope * factor / OMEGA_SI[stated] for unit, factor in OMEGA_SI.items()}
        best = min(slopes, key=lambda unit: abs(np.log(slopes[unit])))
        return (best, slopes[best]) if 1.0 / NEAR < slopes[best] < NEAR else None


def compare_gyros(inertial: Inertial, attitudes: Attitudes) -> GyroFit | None:
    """Turns over steps of a second, longer ones of a slower attitude, and level; None without overlap.

    Args:
        inertial: readings, the rates in any unit.
        attitudes: of the platform, on the clock of the readings.
    """
    time_ns = inertial.time_ns
    inside = np.flatnonzero((attitudes.time_ns >= time_ns[0]) & (attitudes.time_ns <= time_ns[-1]))
    if len(inside) < LEAST_STEPS:
        return None
    every_s = float(np.median(np.diff(attitudes.time_ns[inside]))) * 1e-9
    rows = inside[:: max(1, round(SLOPE_S / every_s))]
    times, own = attitudes.time_ns[rows], attitudes.attitude[rows]
    steps_s = np.diff(times)[:, None] * 1e-9
    good = steps_s[:, 0] <= SLOWEST_STEP_S
    edges = np.arange(times[0], times[-1], round(LEVEL_S * 1e9), dtype=np.int64)
    if good.sum() < LEAST_STEPS or len(edges) < 2:
        return None
    a = ((own[:-1].inv() * own[1:]).as_rotvec() / steps_s)[good]
    b = (integrals(time_ns, inertial.omega_p_radps, times) / steps_s)[good]
    a, b = a - np.median(a, axis=0), b - np.median(b, axis=0)
    level = integrals(attitudes.time_ns, attitudes.attitude.inv().apply([0.0, 0.0, 1.0]), edges)
    down = _unit_rows(level), -_unit_rows(integrals(time_ns, inertial.force_p_mps2, edges))
    rotation = _aligned((a, b), down)
    slope, sd, correlation = _slope(rotation.apply(a), b)
    parts = ((a, b / slope), down)
    before, after = (
        sum(float(np.sum((gyro - r.apply(one)) ** 2) / max(np.sum(gyro**2), 1e-12)) for one, gyro in parts)
        for r in (Rotation.identity(), rotation)
    )
    misfit = float(np.sum((b - a) ** 2)) / max(float(np.sum((b / slope - rotation.apply(a)) ** 2)), 1e-12)
    return GyroFit(len(b), slope, sd, correlation, rotation, after / max(before, 1e-12), misfit)


def _slope(a: Floats, b: Floats) -> tuple[float, float, float]:
    """Slope of turns (n, 3) over others, robust, its 1 sigma, and their correlation."""
    weight, value = np.ones(len(a)), 0.0
    for _ in range(10):
        w = weight[:, None]
        energy = max(float((w * a * a).sum()), 1e-30)
        value = float((w * a * b).sum()) / energy
        left = np.linalg.norm(b - value * a, axis=1)
        weight = 1.0 / np.maximum(1.0, left / max(2.0 * float(np.median(left)), 1e-30))
    w = weight[:, None]
    size = np.sqrt(float((w * a * a).sum()) * float((w * b * b).sum()))
    sd = float(np.sqrt((np.sum(w * a * (b - value * a), axis=1) ** 2).sum())) / energy
    return value or 1e-30, sd, float((w * a * b).sum()) / max(size, 1e-30)


def _aligned(turns: tuple[Floats, Floats], down: tuple[Floats, Floats]) -> Rotation:
    """The rotation from the attitude's axes to the IMU's, by turns and level with the same weight (Kabsch 1976)."""
    (a, b), (level, felt) = turns, down
    k = float(np.sqrt(np.sum(b**2) / max(float(np.sum(a**2)), 1e-12)))
    share = [1.0 / max(float(np.sum(b**2)), 1e-12), 1.0 / len(felt)]
    found, _ = Rotation.align_vectors(
        np.concatenate([b, felt]),
        np.concatenate([k * a, level]),
        weights=np.repeat(share, [len(b), len(felt)]),
    )
    return found


def _unit_rows(values: Floats) -> Floats:
    return np.asarray(values / np.maximum(np.linalg.norm(values, axis=1), 1e-9)[:, None], dtype=np.float64)


def match_gyros(
    time_ns: Integers,
    omega_p_radps: Floats,
    attitude_time_ns: Integers,
    attitude: Rotation,
    interval_s: float,
) -> GyroMatch | None:
    """Offset, wander and noise of gyros, at the times of an attitude; None with too few segments that have both.

    Args:
        time_ns, omega_p_radps: (n,), (n, 3), platform axes.
        attitude_time_ns, attitude: (m,) of the platform, on the clock of the gyros.
        interval_s: between pings, over several of which the noise is found.
    """
    length_s = float(np.clip((time_ns[-1] - time_ns[0]) * 1e-9 / PARTS, SHORTEST_S, LENGTH_S))
    segments = integrate(Inertial(time_ns, np.zeros_like(omega_p_radps), omega_p_radps), length_s=length_s)
    if segments is None:
        return None
    s, m = segments.time_ns.shape
    flat = segments.time_ns.ravel()
    index = np.clip(np.searchsorted(flat, attitude_time_ns, side="right") - 1, 0, s * m - 1)
    segment, after_s = index // m, (attitude_time_ns - flat[index]) * 1e-9
    imu_step_s = float(np.median(np.diff(segments.time_ns[0]))) * 1e-9
    kept = (after_s >= 0.0) & (after_s <= 2.0 * imu_step_s)
    kept &= _whole(segment, attitude_time_ns, kept, s, length_s)[segment]
    if len(np.unique(segment[kept])) < LEAST_SEGMENTS:
        return None
    times, segment, index, after_s = attitude_time_ns[kept], segment[kept], index[kept], after_s[kept]
    omega = segments.omega_p_radps.reshape(-1, 3)[index]
    C = segments.rotation.reshape(-1, 3, 3)[index]
    J = segments.rotation_integral_s.reshape(-1, 3, 3)[index] + C * after_s[:, None, None]
    C = C @ Rotation.from_rotvec(omega * after_s[:, None]).as_matrix()
    own = attitude[kept].as_matrix()
    # Gyros minus attitude since the segment's first attitude, in its axes, where an offset adds ∫C dt times itself.
    _, first, part = np.unique(segment, return_index=True, return_inverse=True)
    since = np.swapaxes(C[first], 1, 2)[part]
    C, J = since @ C, since @ (J - J[first][part])
    own = np.swapaxes(own[first], 1, 2)[part] @ own
    apart = Rotation.from_matrix(np.swapaxes(own, 1, 2) @ C).as_rotvec()
    angle = np.einsum("pij,pj->pi", C, apart)
    offsets = _slopes(J, angle, part)
    left = angle - np.einsum("pij,pj->pi", J, offsets[part])
    offset, scatter = np.median(offsets, axis=0), sd_about_median(offsets, axis=0)
    moved, step_s = _differences(times, part, C, left, interval_s)
    grown = noise_growth(moved, step_s)
    means = segments.omega_p_radps.mean(axis=1)[segment[first]]
    apart_s = float(np.median(np.diff(times[first]))) * 1e-9
    return GyroMatch(
        offset, scatter / np.sqrt(len(offsets)), _wander(offsets, means, apart_s),
        None if grown is None else grown.walk, max((lag for lag, _ in moved), default=1) * step_s,
        # The attitude's own noise is in both ends of a difference.
        np.zeros(3) if grown is None else np.sqrt(0.5 * grown.white),
    )  # fmt: skip


def _whole(segment: Integers, time_ns: Integers, kept: Flags, count: int, length_s: float) -> Flags:
    """Segments that attitudes cover from near the beginning to near the end, without a gap."""
    whole = np.zeros(count, dtype=bool)
    for one in np.unique(segment[kept]):
        times = time_ns[kept & (segment == one)]
        spans = len(times) >= 3 and (times[-1] - times[0]) * 1e-9 > COVERED * length_s
        whole[one] = spans and float(np.diff(times).max()) * 1e-9 <= SLOWEST_STEP_S
    return whole


def _slopes(J: Floats, angle: Floats, part: Integers) -> Floats:
    """(s, 3) offsets of segments by least squares of the angles on the integrals, each from its own mean."""
    counts = np.bincount(part)

    def centred(values: Floats) -> Floats:
        flat = values.reshape(len(values), -1)
        sums = np.stack([np.bincount(part, column) for column in flat.T], axis=1)
        return (flat - (sums / counts[:, None])[part]).reshape(values.shape)

    A, y = centred(J), centred(angle)
    normal, right = np.einsum("pji,pjk->pik", A, A), np.einsum("pji,pj->pi", A, y)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    return np.asarray(
        np.linalg.solve(np.add.reduceat(normal, starts), np.add.reduceat(right, starts)[:, :, None])[:, :, 0]
    )


def _differences(
    time_ns: Integers, part: Integers, C: Floats, left: Floats, interval_s: float
) -> tuple[list[tuple[int, Floats]], float]:
    """What is left over several lags, in steps of the attitude, each with (n, 3) differences; and the step, s."""
    step_s = float(np.median(np.diff(time_ns))) * 1e-9
    wanted = {max(1, round(k * interval_s / step_s)) for k in LAGS if k * interval_s <= LONGEST_LAG_S}
    found = []
    for lag in sorted(wanted | {1, 2, 3} if len(wanted) < 3 else wanted):
        if len(time_ns) <= lag:
            continue
        took_s = (time_ns[lag:] - time_ns[:-lag]) * 1e-9
        good = (part[lag:] == part[:-lag]) & (np.abs(took_s - lag * step_s) < 0.5 * step_s * lag)
        if good.sum() >= LEAST_PAIRS:
            found.append((lag, np.einsum("pji,pj->pi", C[:-lag], left[lag:] - left[:-lag])[good]))
    return found, step_s


def _wander(offsets: Floats, rates: Floats, apart_s: float) -> float:
    """Random walk of the offsets of segments, RMS over the axes, rad/s/√s."""
    # What follows the rate of turn is a scale factor, which does not wander.
    turning = (rates - rates.mean(axis=0)) * (len(rates) >= LEAST_FOR_SCALE)
    follows = (turning * offsets).sum(axis=0) / np.maximum((turning**2).sum(axis=0), 1e-30)
    steady = offsets - turning * follows
    # Of errors of single segments half the mean square of successive differences is the variance (von Neumann 1941);
    # a walk of n steps q has a variance of n q²/6 beyond it.
    count = len(steady)
    middle, sd = np.median(steady, axis=0), sd_about_median(steady, axis=0)
    kept = np.clip(steady - middle, -OUTLIER * sd, OUTLIER * sd)
    variance = kept.var(axis=0, ddof=1)
    alone = 0.5 * (np.diff(kept, axis=0) ** 2).mean(axis=0)
    stands_out = alone < (1.0 - RESOLVED / np.sqrt(count)) * variance
    walked = np.where(stands_out, 6.0 * (variance - alone) / (count * apart_s), 0.0)
    return float(np.sqrt(np.mean(walked)))
