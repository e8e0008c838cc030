"""A recorded attitude against the IMU: frame, clock, mounting and scale of its turns, and what the gyros add to them.

Turns over steps of a second, a of the attitude and b of the gyros, are compared as

    b(t + clock) = scale · rotation · stands · a(t) + offset

in which `stands` is one of the ways in which an attitude sensor stands on a vehicle, and `rotation` what is left of its
mounting, by turns and by the direction of gravity. Sums of the readings do for that, whatever their unit. What the
gyros integrate to over longer times, in their right unit, is held against the attitude by `gyro_errors`: the noise
found covers their scale, turns between two readings and the error of the attitude itself.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bottomlock.recordings.axes import FLU_FROM_FRD
from bottomlock.recordings.noise_growth import Walk, noise_growth
from bottomlock.recordings.rig_motion import LENGTH_S, applied, integrate
from bottomlock.recordings.robust import sd_about_median
from bottomlock.recordings.rotation import rotation_matrices, rotation_vectors
from bottomlock.recordings.streams import Attitudes, Flags, Floats, Inertial, Integers, integrator

FRAMES = {"ned_frd": np.eye(3), "enu_flu": FLU_FROM_FRD}
"""Frames of an attitude, and what takes its turns to forward, right and down."""
STATED = ("ned_frd",)
STEP_S, SLOWEST_STEP_S = 1.0, 5.0
"""Step of the turns: longer than jitter of the stamps, shorter than a wander of the offset; and the longest one."""
LEAST_STEPS = 10
JUMP = 8.0
"""A turn so many times larger than those of the gyros is a wrap, or a reset of the attitude's filter."""
COARSE_S, FINE_S = (
    tuple(step_s * k for k in range(-most, most + 1)) for step_s, most in ((0.25, 12), (0.05, 4))
)
"""Clock offsets that are tried, and those about the best of them: turns over a second change little in a quarter."""
LEVEL, OFF_QUARTER_RAD = 0.5, np.deg2rad(20.0)
"""Correlation of roll and pitch from which they tell a quarter turn of the sensor, and how near to it they turn."""
DECIDES, APART = 0.4, 0.1
"""Correlation of turns from which they decide the frame, and by how much it exceeds that in the other."""


class _Way(NamedTuple):
    """How an attitude sensor may stand, see `AttitudeFit`."""

    correlation: float
    frame: str
    quarters: int
    clock_s: float
    of_axes: tuple[float, ...]

    @property
    def stands(self) -> Floats:
        """(3, 3) from its turns to those of the platform."""
        return np.asarray(
            rotation_matrices(np.array([0.0, 0.0, 0.5 * np.pi * self.quarters])) @ FRAMES[self.frame]
        )


@dataclass(frozen=True, eq=False)
class AttitudeFit:
    """An attitude against gyros and accelerometers.

    Attributes:
        correlation: of the turns in the frame in which it is largest.
        frame: "ned_frd" or "enu_flu".
        quarters: of a turn, from the sensor's forward to starboard, by which its axes stand on the platform.
        clock_s: to add to the attitude's times.
        of_axes: (3,) correlation about each axis of the platform.
        other: correlation in the other frame, at best; −1 without.
        steps: number of steps.
        rotation: (3, 3) from the attitude's axes, after frame and quarters, to those of the IMU.
        scale, scale_sd: of the gyros over the attitude, 1 in the right unit, robust, and its 1 sigma.
        alike: correlation of the turns with that rotation.
        rotation_gain, scale_gain: chi-squared that each explains with the other one as found.
    """

    correlation: float
    frame: str
    quarters: int
    clock_s: float
    of_axes: tuple[float, ...]
    other: float
    steps: int
    rotation: Floats
    scale: float
    scale_sd: float
    alike: float
    rotation_gain: float
    scale_gain: float

    @property
    def least(self) -> float:
        """Smallest correlation of a single axis."""
        return min(self.of_axes)

    @property
    def clear(self) -> bool:
        """Whether the turns decide the frame."""
        return self.correlation > DECIDES and self.correlation > self.other + APART


def fit_attitude(inertial: Inertial, attitudes: Attitudes, *, search: bool = False) -> AttitudeFit | None:
    """Compares an attitude with an IMU; None where fewer than `LEAST_STEPS` steps are of both.

    Args:
        inertial: readings in platform axes, the rates in any unit.
        attitudes: of the platform; with `search`, of a sensor in either frame and at any quarter turn, whose clock may
            be off by `COARSE_S`.
        search: whether frame, quarter turn and clock are to be found.
    """
    if min(len(attitudes.time_ns), len(inertial.time_ns)) < LEAST_STEPS:
        return None
    every_s = float(np.median(np.diff(attitudes.time_ns))) * 1e-9
    thin = slice(None, None, max(1, round(STEP_S / max(every_s, 1e-9))))
    time_ns, attitude = attitudes.time_ns[thin], attitudes.attitude[thin]
    steps_s = np.diff(time_ns)[:, None] * 1e-9
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / steps_s
    felt = np.concatenate([inertial.omega_p_radps, inertial.force_p_mps2], axis=1)
    between = integrator(inertial.time_ns, felt, int(time_ns[0]))

    def both(clock_s: float) -> tuple[Flags, Floats]:
        """Which steps are of both, and the means of the readings over these, (n, 6)."""
        moved = time_ns + round(clock_s * 1e9)
        inside = (moved[:-1] >= inertial.time_ns[0]) & (moved[1:] <= inertial.time_ns[-1])
        inside &= steps_s[:, 0] <= SLOWEST_STEP_S
        return inside, (between(moved) / steps_s)[inside]

    def ways(clock_s: float) -> list[_Way]:
        inside, means = both(clock_s)
        if inside.sum() < LEAST_STEPS:
            return []
        a, b = turned[inside], means[:, :3]
        calm = _size(a) < JUMP * np.maximum(_size(b), 1.0)
        a, b = (x[calm] - x[calm].mean(axis=0) for x in (a, b))
        return [_way(a, b, frame, clock_s, search=search) for frame in (FRAMES if search else STATED)]

    found = [way for clock_s in (COARSE_S if search else (0.0,)) for way in ways(clock_s)]
    found += [
        way for off_s in (FINE_S if search and found else ()) for way in ways(max(found).clock_s + off_s)
    ]
    if not found:
        return None
    best = max(found)
    other = max((one.correlation for one in found if one.frame != best.frame), default=-1.0)
    inside, means = both(best.clock_s)
    # Up changes its sign from one frame to the other, and so does the vertical axis of the sensor.
    vertical = attitude.inv().apply([0.0, 0.0, 1.0]) @ best.stands.T * best.stands[2, 2]
    down = _unit(vertical[:-1] + vertical[1:])[inside], -_unit(means[:, 3:])
    a, b = (x - np.median(x, axis=0) for x in (turned[inside] @ best.stands.T, means[:, :3]))
    return _fitted(best, other, (a, b), down)


def _way(a: Floats, b: Floats, frame: str, clock_s: float, *, search: bool) -> _Way:
    """Centred turns (n, 3) in a frame, at the quarter turn that fits roll and pitch best."""
    x, quarters = a @ FRAMES[frame].T, 0
    across, along = x[:, 0] @ b[:, 1] - x[:, 1] @ b[:, 0], x[:, 0] @ b[:, 0] + x[:, 1] @ b[:, 1]
    nearest = round(2.0 / np.pi * np.arctan2(across, along))
    off = np.arctan2(across, along) - 0.5 * np.pi * nearest
    if search and abs(off) < OFF_QUARTER_RAD:
        size = np.linalg.norm(x[:, :2]) * np.linalg.norm(b[:, :2])
        if np.hypot(along, across) > LEVEL * size:
            quarters = 2 if nearest == -2 else nearest
    way = _Way(0.0, frame, quarters, clock_s, ())
    x = a @ way.stands.T
    of_axes = (x * b).sum(axis=0) / np.maximum(np.linalg.norm(x, axis=0) * np.linalg.norm(b, axis=0), 1e-12)
    correlation = float((x * b).sum()) / max(float(np.linalg.norm(x) * np.linalg.norm(b)), 1e-30)
    return way._replace(correlation=correlation, of_axes=tuple(of_axes.tolist()))


def _size(turns: Floats) -> Floats:
    """Sizes of turns (n, 3) over that which nine tenths of them stay below."""
    size = np.linalg.norm(turns, axis=1)
    return np.asarray(size / max(float(np.percentile(size, 90)), 1e-12))


def _unit(values: Floats) -> Floats:
    return np.asarray(values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-9))


def _fitted(
    way: _Way, other: float, turns: tuple[Floats, Floats], down: tuple[Floats, Floats]
) -> AttitudeFit:
    """Rotation and scale, by turns and level (n, 3) with the same weight (Kabsch 1976)."""
    (a, b), (level, felt) = turns, down
    rough = float(np.linalg.norm(b) / max(float(np.linalg.norm(a)), 1e-9))
    U, _, V = np.linalg.svd(rough * b.T @ a / max(float((b**2).sum()), 1e-12) + felt.T @ level / len(felt))
    rotation = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    x = a @ rotation.T
    weight, scale = np.ones((len(a), 1)), 0.0
    for _ in range(10):
        energy = max(float((weight * x * x).sum()), 1e-30)
        scale = float((weight * x * b).sum()) / energy or 1e-30
        left = np.linalg.norm(b - scale * x, axis=1, keepdims=True)
        weight = 1.0 / np.maximum(1.0, left / max(2.0 * float(np.median(left)), 1e-30))
    sd = float(np.linalg.norm((weight * x * (b - scale * x)).sum(axis=1))) / energy
    size = float(np.sqrt((weight * x * x).sum() * (weight * b * b).sum()))
    alike = float((weight * x * b).sum()) / max(size, 1e-30)

    def misfit(scale_is: float, rotation_is: Floats) -> float:
        off = [b / scale_is - a @ rotation_is.T, felt - level @ rotation_is.T]
        sizes = [max(float(((b / scale) ** 2).sum()), 1e-12), len(felt)]
        return max(sum(float((one**2).sum()) / of for one, of in zip(off, sizes, strict=True)), 1e-12)

    least = misfit(scale, rotation)
    without = misfit(scale, np.eye(3)), misfit(1.0, rotation)
    gains = (3.0 * len(b) * (one / least - 1.0) for one in without)
    return AttitudeFit(*way, other, len(b), rotation, scale, sd, alike, *gains)


PARTS, SHORTEST_S = 8, 4.0
"""A short recording is cut into about so many segments, none shorter than so many seconds."""
LEAST_SEGMENTS, LEAST_PAIRS = 4, 20
OUTLIER, RESOLVED = 4.0, 2.0
"""Sigmas of an outlier, and those from which a wander of the offset is told from the errors of single segments."""
LEAST_FOR_SCALE = 10
"""Segments from which a scale factor is told from a wander of the offset."""
LONGEST_LAG_S = 6.0
LAGS = (1, 2, 3, 4, 6, 8, 12, 16, 24)
"""Intervals between pings over which the noise is found."""


@dataclass(frozen=True, eq=False)
class GyroErrors:
    """Errors of gyros against an attitude.

    Attributes:
        offset_radps, offset_sd_radps: (3,) mean difference, gyros minus attitude, and its 1 sigma.
        wander_radps_rts: random walk of the offset, RMS over the axes, rad/s/√s; 0 where it does not stand out.
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


def gyro_errors(inertial: Inertial, attitudes: Attitudes, interval_s: float) -> GyroErrors | None:
    """Offset, wander and noise of gyros against an attitude; None with too few segments that have both.

    Args:
        inertial: readings in platform axes; the forces do not matter.
        attitudes: of the platform, on the clock of the readings.
        interval_s: between pings, over several of which the noise is found.
    """
    seconds = float(inertial.time_ns[-1] - inertial.time_ns[0]) * 1e-9
    segments = integrate(inertial, length_s=float(np.clip(seconds / PARTS, SHORTEST_S, LENGTH_S)))
    if segments is None:
        return None
    at = segments.at(attitudes.time_ns)
    first = np.flatnonzero(np.diff(at.segment, prepend=-1))
    if len(first) < LEAST_SEGMENTS:
        return None
    part = np.repeat(np.arange(len(first)), np.diff(first, append=len(at.segment)))
    own = attitudes.attitude[at.kept].as_matrix()
    # Gyros minus attitude since the segment's first attitude, in its axes, where an offset adds ∫C dt times itself.
    C, own = (np.swapaxes(x[first], 1, 2)[part] @ x for x in (at.C, own))
    J = np.swapaxes(at.C[first], 1, 2)[part] @ (at.J - at.J[first][part])
    angle = applied(C, rotation_vectors(np.swapaxes(own, 1, 2) @ C))
    offsets = _slopes(J, angle, first, part)
    left = angle - applied(J, offsets[part])
    step_s = float(np.median(np.diff(at.time_s)))
    lags = {max(1, round(k * interval_s / step_s)) for k in LAGS if k * interval_s <= LONGEST_LAG_S}
    moved = []
    for lag in sorted(lags | {1, 2, 3} if len(lags) < 3 else lags):
        even = np.abs(at.time_s[lag:] - at.time_s[:-lag] - lag * step_s) < 0.5 * step_s * lag
        even &= part[lag:] == part[:-lag]
        if even.sum() >= LEAST_PAIRS:
            moved.append((lag, np.einsum("pji,pj->pi", C[:-lag], left[lag:] - left[:-lag])[even]))
    grown = noise_growth(moved, step_s)
    number = at.segment[first]
    apart_s = float(np.median(np.diff(at.begins_ns[number]))) * 1e-9
    return GyroErrors(
        np.median(offsets, axis=0), sd_about_median(offsets, axis=0) / np.sqrt(len(offsets)),
        _wander(offsets, segments.omega_p_radps.mean(axis=1)[number], apart_s),
        None if grown is None else grown.walk, max((lag for lag, _ in moved), default=1) * step_s,
        # The attitude's own noise is in both ends of a difference.
        np.zeros(3) if grown is None else np.sqrt(0.5 * grown.white),
    )  # fmt: skip


def _slopes(J: Floats, angle: Floats, first: Integers, part: Integers) -> Floats:
    """(s, 3) offsets of segments by least squares of the angles on the integrals, each from its own mean."""
    counts = np.bincount(part)
    A = J - (np.add.reduceat(J, first) / counts[:, None, None])[part]
    y = angle - (np.add.reduceat(angle, first) / counts[:, None])[part]
    normal = np.add.reduceat(np.einsum("pji,pjk->pik", A, A), first)
    right = np.add.reduceat(np.einsum("pji,pj->pi", A, y), first)
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, :, 0])


def _wander(offsets: Floats, rates: Floats, apart_s: float) -> float:
    """Random walk of the offsets of segments (s, 3), RMS over the axes, rad/s/√s; 0 where it does not stand out."""
    # What follows the rate of turn is a scale factor, which does not wander.
    turning = (rates - rates.mean(axis=0)) * (len(rates) >= LEAST_FOR_SCALE)
    steady = offsets - turning * (turning * offsets).sum(axis=0) / np.maximum((turning**2).sum(axis=0), 1e-30)
    # Of errors of single segments half the mean square of successive differences is the variance (von Neumann 1941);
    # a walk of n steps q has a variance of n q²/6 beyond it.
    middle, sd = np.median(steady, axis=0), sd_about_median(steady, axis=0)
    kept = np.clip(steady - middle, -OUTLIER * sd, OUTLIER * sd)
    variance = kept.var(axis=0, ddof=1)
    alone = 0.5 * (np.diff(kept, axis=0) ** 2).mean(axis=0)
    stands_out = alone < (1.0 - RESOLVED / np.sqrt(len(kept))) * variance
    return float(np.sqrt(np.where(stands_out, 6.0 * (variance - alone) / (len(kept) * apart_s), 0.0).mean()))
