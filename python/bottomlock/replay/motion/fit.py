"""What has to be changed so that a velocity follows the inertial readings: mounting, scale, clock, biases, lever arm.

With v_s the velocity as stated, in platform axes and on the stated clock, the velocity of the IMU at the time t + τ is

    v = (1 + s) exp(ρ) M v_s(t) − ω × l

with M a signed permutation of the axes. Its departure from the line of `segments` gives every parameter by least
squares (Gauss-Newton, Huber's loss). A prior of each parameter states how far it may be from zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.streams import Flags, Floats, Integers
from bottomlock.replay.motion.segments import Segments, integrate
from bottomlock.statistics.robust import sd_about_zero

PARTS = {
    "rotation": slice(0, 3), "scale": slice(3, 4), "clock": slice(4, 5), "gyro_bias": slice(5, 8),
    "accel_bias": slice(8, 11), "lever": slice(11, 14),
}  # fmt: skip
"""Places of the parameters: rad about platform axes, 1, s, rad/s, m/s², m."""
SIZE = 14
LEAST_PINGS = 5
"""Pings of a segment that is used: a line takes two."""
HUBER = 2.0
PASSES = 6
REINTEGRATED_RAD = 0.005
"""Change of a gyro bias over a segment from which the readings are integrated again."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Inertial readings and velocities as stated.

    Attributes:
        imu_time_ns, force_p_mps2, omega_p_radps: (n,), (n, 3), (n, 3), platform axes.
        time_ns, velocity_p_mps: (p,), (p, 3) pings.
    """

    imu_time_ns: Integers
    force_p_mps2: Floats
    omega_p_radps: Floats
    time_ns: Integers
    velocity_p_mps: Floats

    def with_gyros(self, factor: float | Floats) -> "Recorded":
        """The same with the rates multiplied, all alike or each axis (3,) by its own."""
        return Recorded(
            self.imu_time_ns,
            self.force_p_mps2,
            factor * self.omega_p_radps,
            self.time_ns,
            self.velocity_p_mps,
        )


@dataclass(frozen=True, eq=False)
class Match:
    """Result of a fit.

    Attributes:
        axes: (3, 3) M.
        values, sd: (14,) parameters, see `PARTS`, and their 1 sigma, by scores of whole segments.
        cost: sum of Huber's loss of residuals over `sigma_mps`, and of the priors.
        sigma_mps: robust sigma of the residuals.
        gravity_mps2: (s,) size of the slope of every segment.
        level_p: (s, 3) unit vector down in the platform axes at the beginning of each segment.
        begins_ns: (s,) times of these.
        pings: number used.
    """

    axes: Floats
    values: Floats
    sd: Floats
    cost: float
    sigma_mps: float
    gravity_mps2: Floats
    level_p: Floats
    begins_ns: Integers
    pings: int

    def part(self, name: str) -> Floats:
        """A parameter."""
        return np.asarray(self.values[PARTS[name]])

    def part_sd(self, name: str) -> Floats:
        """Its 1 sigma."""
        return np.asarray(self.sd[PARTS[name]])

    @property
    def rotation(self) -> Rotation:
        """From the velocity's axes as stated, after `axes`, to the platform's."""
        return Rotation.from_rotvec(self.part("rotation"))

    @property
    def gravity(self) -> float:
        """Median size of the slopes, m/s²; NaN without a segment with pings."""
        used = self.gravity_mps2 > 0.0
        return float(np.median(self.gravity_mps2[used])) if used.any() else float("nan")

    @property
    def plausible(self) -> bool:
        """Whether the fit found gravity where it is, and no turn or bias that only a wrong model needs."""
        turn, bias = np.linalg.norm(self.part("rotation")), np.linalg.norm(self.part("accel_bias"))
        return bool(abs(self.gravity - 9.81) < 0.1 and turn < 0.4 and bias < 0.3)


@dataclass(frozen=True, eq=False)
class _At:
    """Integrals at the pings, (p, ...), for one clock offset."""

    kept: Flags
    segment: Integers
    time_s: Floats
    C: Floats
    S: Floats
    J: Floats
    K: Floats
    force: Floats
    omega: Floats


def at_pings(segments: Segments, time_ns: Integers) -> _At:
    """The integrals at the pings that lie in a segment with enough of them; `time_ns` on the IMU's clock."""
    s, m = segments.time_ns.shape
    flat = segments.time_ns.ravel()
    index = np.clip(np.searchsorted(flat, time_ns, side="right") - 1, 0, s * m - 1)
    segment = index // m
    after_s = (time_ns - flat[index]) * 1e-9
    step_s = float(np.median(np.diff(segments.time_ns[0]))) * 1e-9
    kept = (after_s >= 0.0) & (after_s <= 2.0 * step_s)
    counts = np.bincount(segment[kept], minlength=s)
    kept &= counts[segment] >= LEAST_PINGS
    index, segment, after_s = index[kept], segment[kept], after_s[kept]

    def rows(values: Floats) -> Floats:
        return np.asarray(values.reshape(s * m, *values.shape[2:])[index])

    C, force, omega = rows(segments.rotation), rows(segments.force_p_mps2), rows(segments.omega_p_radps)
    S = rows(segments.force_integral_mps) + _of(C, force) * after_s[:, None]
    begins = segments.time_ns[:, 0][segment]
    if len(C):
        C = C @ Rotation.from_rotvec(omega * after_s[:, None]).as_matrix()
    return _At(
        kept, segment, (time_ns[kept] - begins) * 1e-9, C, S, rows(segments.rotation_integral_s),
        rows(segments.bias_integral), force, omega,
    )  # fmt: skip


def lines(values: Floats, at: _At, segments: int) -> tuple[Floats, Floats]:
    """Residuals of columns (p, 3, c) from a line in every segment, and the slopes (s, 3, c)."""
    flat = values.reshape(len(values), -1)

    def sums(column: Floats) -> Floats:
        return np.stack(
            [np.bincount(at.segment, column[:, k], minlength=segments) for k in range(column.shape[1])],
            axis=1,
        )

    n = np.maximum(np.bincount(at.segment, minlength=segments), 1)[:, None]
    mean_t = sums(at.time_s[:, None]) / n
    t = at.time_s[:, None] - mean_t[at.segment]
    mean = sums(flat) / n
    centred = flat - mean[at.segment]
    slope = sums(t * centred) / np.maximum(sums(t * t), 1e-12)
    left = centred - t * slope[at.segment]
    return left.reshape(values.shape), slope.reshape(segments, *values.shape[1:])


def _skew(v: Floats) -> Floats:
    """[v×] of vectors (p, 3)."""
    matrix = np.zeros((len(v), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[:, j, i], matrix[:, i, j] = v[:, k], -v[:, k]
    return matrix


def _of(matrix: Floats, v: Floats) -> Floats:
    """Matrices (p, 3, 3) times vectors (p, 3)."""
    return np.asarray(np.einsum("pij,pj->pi", matrix, v))


def _columns(at: _At, stated: Floats, felt: Floats, scale: float) -> Floats:
    """(p, 3, 14) derivatives of C v_s − felt / (1 + s) by the parameters.

    The scale divides the inertial side, which is free of the DVL's noise: as a factor of the velocity it would become
    too small, because that makes the noise smaller as well.

    Args:
        at: the integrals.
        stated: (p, 3) velocity in platform axes, rotated.
        felt: (p, 3) what the IMU says of it.
        scale: s.
    """
    columns = np.empty((len(stated), 3, SIZE))
    k = 1.0 / (1.0 + scale)
    omega_cross = _skew(at.omega)
    columns[:, :, 0:3] = -at.C @ _skew(stated)
    columns[:, :, 3] = k * k * felt
    columns[:, :, 4] = _of(at.C, _of(omega_cross, stated) - k * at.force)
    columns[:, :, 5:8] = k * at.K + _skew(_of(at.C, stated)) @ at.J
    columns[:, :, 8:11] = k * at.J
    columns[:, :, 11:14] = -k * at.C @ omega_cross
    return columns


def fit(
    recorded: Recorded,
    prior_sd: Mapping[str, float],
    *,
    axes: Floats | None = None,
    clock_s: float = 0.0,
    sigma_mps: float | None = None,
) -> Match | None:
    """Fits the parameters; None where the recording has too few pings in whole segments.

    Args:
        recorded: readings and velocities.
        prior_sd: 1 sigma of each of `PARTS` about zero.
        axes: (3, 3) M; the identity by default.
        clock_s: clock offset to begin from.
        sigma_mps: of a ping and axis, for costs that are compared; estimated by default.
    """
    M = np.eye(3) if axes is None else axes
    p = np.zeros(SIZE)
    p[4] = clock_s
    sd0 = np.concatenate([np.full(part.stop - part.start, prior_sd[name]) for name, part in PARTS.items()])
    used = np.zeros(3)
    segments = integrate(recorded.imu_time_ns, recorded.force_p_mps2, recorded.omega_p_radps)
    if segments is None:
        return None
    length_s = float(segments.time_ns[0, -1] - segments.time_ns[0, 0]) * 1e-9
    sigma = sigma_mps
    result = None
    for _ in range(PASSES):
        if float(np.abs(p[5:8] - used).max()) * length_s > REINTEGRATED_RAD:
            used = p[5:8].copy()
            segments = integrate(recorded.imu_time_ns, recorded.force_p_mps2, recorded.omega_p_radps - used)
            assert segments is not None  # the same readings as before
        at = at_pings(segments, recorded.time_ns + round(float(p[4]) * 1e9))
        if at.kept.sum() < 4 * LEAST_PINGS:
            return result
        stated = Rotation.from_rotvec(p[:3]).apply(recorded.velocity_p_mps[at.kept] @ M.T)
        felt = _of(at.C, _skew(at.omega) @ p[11:14]) + at.S - at.J @ p[8:11]
        X = _columns(at, stated, felt, float(p[3]))
        value = _of(at.C, stated) - felt / (1.0 + p[3])
        value += X[:, :, 5:8] @ (p[5:8] - used)
        left, slope = lines(np.concatenate([value[:, :, None], X], axis=2), at, segments.count)
        r, A = left[:, :, 0], left[:, :, 1:]
        scale = sigma_mps or max(float(sd_about_zero(r)), 1e-4)
        sigma = scale
        size = np.sqrt((r**2).sum(axis=1)) / (scale * np.sqrt(3.0))
        weight = np.where(size > HUBER, HUBER / np.maximum(size, 1e-12), 1.0)
        normal = np.einsum("p,pki,pkj->ij", weight, A, A) / scale**2 + np.diag(sd0**-2)
        scores = np.einsum("p,pki,pk->pi", weight, A, r) / scale**2
        step = -np.linalg.solve(normal, scores.sum(axis=0) + p / sd0**2)
        loss = np.where(size > HUBER, HUBER * (2.0 * size - HUBER), size**2)
        result = Match(
            axes=M, values=p.copy(), sd=_sd(normal, scores, at.segment, segments.count),
            cost=float(3.0 * loss.sum() + ((p / sd0) ** 2).sum()), sigma_mps=sigma,
            gravity_mps2=np.linalg.norm(slope[:, :, 0], axis=1),
            level_p=slope[:, :, 0] / np.maximum(np.linalg.norm(slope[:, :, 0], axis=1), 1e-9)[:, None],
            begins_ns=segments.time_ns[:, 0], pings=int(at.kept.sum()),
        )  # fmt: skip
        p = p + np.clip(step, -_LARGEST, _LARGEST)
        p[3] = max(p[3], -0.9)
    return result


_LARGEST = np.array([0.5] * 3 + [0.5, 0.5] + [0.05] * 3 + [1.0] * 3 + [2.0] * 3)
"""Largest change in a pass."""


def _sd(normal: Floats, scores: Floats, segment: Integers, count: int) -> Floats:
    """1 sigma: the larger of that of independent residuals and that of independent segments."""
    inverse = np.linalg.inv(normal)
    summed = np.stack([np.bincount(segment, scores[:, k], minlength=count) for k in range(SIZE)], axis=1)
    sandwich = inverse @ (summed.T @ summed) @ inverse
    return np.sqrt(np.maximum(np.diag(inverse), np.diag(sandwich)))


LOOSE = {
    "rotation": 1.0, "scale": 0.3, "clock": 1.0, "gyro_bias": 0.05, "accel_bias": 0.5, "lever": 1.0,
}  # fmt: skip
"""1 sigma where nothing is known: rad, 1, s, rad/s, m/s², m."""
GRID_S = 0.25
"""Step of the search of clock offsets: body motion lasts longer."""
MOST_LAGS = 4000


@dataclass(frozen=True, eq=False)
class Searched:
    """A clock offset found by a search.

    Attributes:
        offset_s: to add to the velocity's times.
        gain: how many times smaller the residual is than at the median of all offsets.
        second: the same of the best offset that is more than 3 s away.
    """

    offset_s: float
    gain: float
    second: float

    @property
    def clear(self) -> bool:
        """Whether the offset stands out."""
        return self.gain > 2.0 and self.gain > 1.3 * self.second


def _residual(segments: Segments, recorded: Recorded, offset_ns: int) -> float:
    """RMS residual, m/s, with any matrix between the axes, gyro and accelerometer biases; NaN with too few pings."""
    at = at_pings(segments, recorded.time_ns + offset_ns)
    if at.kept.sum() < 6 * LEAST_PINGS:
        return float("nan")
    v = recorded.velocity_p_mps[at.kept]
    columns = (at.C[:, :, :, None] * v[:, None, None, :]).reshape(len(v), 3, 9)
    stacked = np.concatenate([at.S[:, :, None], columns, at.J, at.K], axis=2)
    left, _ = lines(stacked, at, segments.count)
    flat = left.reshape(-1, stacked.shape[2])
    A, y = flat[:, 1:], flat[:, 0]
    normal = A.T @ A
    normal += np.diag(1e-9 * np.diag(normal) + 1e-12)
    answer = np.linalg.solve(normal, A.T @ y)
    left_over = float(y @ y - answer @ (A.T @ y))
    return float(np.sqrt(max(left_over, 0.0) / max(1.0, len(y) - 16.0)))


def search_offset(recorded: Recorded, from_s: float, to_s: float) -> Searched | None:
    """The clock offset, within a range, at which a velocity follows the inertial readings best.

    Args:
        recorded: readings and velocities, in any axes of their own.
        from_s, to_s: range of the offset to add to the velocity's times.
    """
    segments = integrate(recorded.imu_time_ns, recorded.force_p_mps2, recorded.omega_p_radps)
    if segments is None or not to_s > from_s:
        return None
    step_s = max(GRID_S, (to_s - from_s) / MOST_LAGS)
    lags = np.arange(from_s, to_s + 0.5 * step_s, step_s)
    cost = np.array([_residual(segments, recorded, round(float(lag) * 1e9)) for lag in lags])
    known = np.isfinite(cost)
    if int(known.sum()) < 5:
        return None
    best = int(np.nanargmin(cost))
    usual = float(np.nanmedian(cost))
    away = known & (np.abs(lags - lags[best]) > 3.0)
    second = float(np.nanmin(cost[away])) if away.any() else usual
    least = max(float(cost[best]), 1e-9)
    return Searched(_vertex(lags, cost, best), usual / least, usual / max(second, 1e-9))


def _vertex(lags: Floats, cost: Floats, best: int) -> float:
    """The least of the parabola through the best offset and its neighbours."""
    if not 0 < best < len(lags) - 1 or not np.isfinite(cost[best - 1 : best + 2]).all():
        return float(lags[best])
    before, here, after = cost[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(lags[best] + np.clip(shift, -0.5, 0.5) * (lags[1] - lags[0]))
