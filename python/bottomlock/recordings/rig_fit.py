"""What has to be changed so that a velocity follows a motion: mounting, scale, clock, biases, lever arm.

With v_s the velocity as stated, in platform axes and on the stated clock, the velocity of the IMU at the time t + τ is

    v = (1 + s) exp(ρ) M v_s(t) − ω × l

with M a signed permutation of the axes. Its departure from the line of `rig_segments`, or from a recorded velocity,
gives every parameter by least squares (Gauss-Newton, Huber's loss). A prior of each parameter states how far it may be
from zero.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bottomlock.recordings.rig_motion import LEAST_PINGS, AtPings, Segments, Tracked, applied, integrate
from bottomlock.recordings.robust import correlation_blocks, sd_about_median, sd_about_zero
from bottomlock.recordings.rotation import rotation_matrices, skew
from bottomlock.recordings.streams import Floats, Inertial, Integers

PARTS = {
    "rotation": slice(0, 3), "scale": slice(3, 4), "clock": slice(4, 5), "gyro_bias": slice(5, 8),
    "accel_bias": slice(8, 11), "lever": slice(11, 14),
}  # fmt: skip
"""Places of the parameters: rad about platform axes, 1, s, rad/s, m/s², m."""
SIZE = 14
LOOSE = {
    "rotation": 1.0, "scale": 0.3, "clock": 1.0, "gyro_bias": 0.05, "accel_bias": 0.5, "lever": 1.0,
}  # fmt: skip
"""1 sigma where nothing is known: rad, 1, s, rad/s, m/s², m."""
HUBER = 2.0
PASSES = 6
REINTEGRATED_RAD = 0.005
"""Change of a gyro bias over a segment from which the readings are integrated again."""
AROUND_S = 0.5
"""Least distance of the pings whose derivatives are instrumental variables."""
LEAST_STRENGTH = 10.0
"""Standard deviations of the slope of a derivative on its instrument, below which a parameter stays where it began.

It is F = 100, where a t-test of the parameter is right (Lee et al. 2022)."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A motion in platform axes, and velocities as stated: times (p,) and (p, 3) in m/s."""

    motion: Inertial | Tracked
    time_ns: Integers
    velocity_p_mps: Floats

    def integrated(self, gyro_bias_radps: Floats | float = 0.0) -> Segments | Tracked | None:
        """The motion as it is held against the velocities; None for readings without a whole segment."""
        if isinstance(self.motion, Tracked):
            return self.motion
        return integrate(self.motion, gyro_bias_radps=gyro_bias_radps)

    def with_gyros(self, factor: float | Floats) -> "Recorded":
        """The same with the rates multiplied, all alike or each axis (3,) by its own."""
        assert isinstance(self.motion, Inertial)
        return replace(self, motion=replace(self.motion, omega_p_radps=factor * self.motion.omega_p_radps))


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
        blocks: parts of them that stand for independent ones.
        residual_mps: (3,) robust sigma of the residuals, platform axes.
        explained: fraction of the mean square of the velocity, or of its departure from the lines, that is explained.
        rate_rms_radps: (3,) RMS angular rate at the pings.
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
    blocks: int
    residual_mps: Floats
    explained: float
    rate_rms_radps: Floats

    def part(self, name: str) -> Floats:
        """A parameter."""
        return np.asarray(self.values[PARTS[name]])

    def part_sd(self, name: str) -> Floats:
        """Its 1 sigma."""
        return np.asarray(self.sd[PARTS[name]])

    @property
    def rotation(self) -> Floats:
        """(3, 3) from the velocity's axes as stated, after `axes`, to the platform's."""
        return rotation_matrices(self.part("rotation"))

    @property
    def turned(self) -> Floats:
        """(3, 3) from the velocity's axes as stated to the platform's; left-handed where those of one of both are."""
        return np.asarray(self.rotation @ self.axes)

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


def _columns(at: AtPings, stated: Floats, felt: Floats, p: Floats) -> Floats:
    """(p, 3, 14) derivatives of C v_s − felt / (1 + s) by the parameters.

    The scale divides the inertial side, which is free of the DVL's noise: as a factor of the velocity it would become
    too small, because that makes the noise smaller as well.

    Args:
        at: the integrals.
        stated: (p, 3) velocity in platform axes, rotated.
        felt: (p, 3) what the motion says of it.
        p: (14,) parameters.
    """
    columns = np.empty((len(stated), 3, SIZE))
    k = 1.0 / (1.0 + p[3])
    omega_cross = skew(at.omega)
    columns[:, :, 0:3] = -at.C @ skew(stated)
    columns[:, :, 3] = k * k * felt
    columns[:, :, 4] = applied(
        at.C, applied(omega_cross, stated) - k * (at.force + skew(at.turning) @ p[11:14])
    )
    columns[:, :, 5:8] = k * at.K + skew(applied(at.C, stated)) @ at.J
    columns[:, :, 8:11] = k * at.J
    columns[:, :, 11:14] = -k * at.C @ omega_cross
    return columns


def fit(
    recorded: Recorded,
    *,
    prior: Mapping[str, float],
    free: Collection[str] = (),
    axes: Floats | None = None,
    clock_s: float = 0.0,
    sigma_mps: float | None = None,
    around: bool = False,
) -> Match | None:
    """Fits the parameters; None where the recording has too few pings in whole segments.

    Args:
        recorded: motion and velocities.
        prior: 1 sigma of each of `PARTS` about zero.
        free: those of which nothing is known, as `LOOSE` has it.
        axes: (3, 3) M; the identity by default.
        clock_s: clock offset to begin from.
        sigma_mps: of a ping and axis, for costs that are compared; estimated by default.
        around: take the derivatives at the pings around as instrumental variables, which share the motion with those of
            a ping and none of their noise, and blocks of pings for independent ones. A parameter whose derivative
            hardly follows them stays where it began, with the sigma of its prior.
    """
    M = np.eye(3) if axes is None else axes
    p = np.zeros(SIZE)
    p[4] = clock_s
    one_sigma = {name: (LOOSE if name in free else prior)[name] for name in PARTS}
    sd0 = np.concatenate([np.full(part.stop - part.start, one_sigma[name]) for name, part in PARTS.items()])
    used = np.zeros(3)
    motion = recorded.integrated()
    if motion is None:
        return None
    strong = np.ones(SIZE, dtype=bool)
    last = None
    for _ in range(PASSES):
        if (
            isinstance(motion, Segments)
            and float(np.abs(p[5:8] - used).max()) * motion.length_s > REINTEGRATED_RAD
        ):
            used = p[5:8].copy()
            motion = recorded.integrated(used)
            assert motion is not None  # the same readings as before
        at = motion.at(recorded.time_ns + round(float(p[4]) * 1e9))
        if at.kept.sum() < 4 * LEAST_PINGS:
            break
        stated = recorded.velocity_p_mps[at.kept] @ (rotation_matrices(p[:3]) @ M).T
        felt = applied(at.C, skew(at.omega) @ p[11:14]) + at.S - at.J @ p[8:11]
        X = _columns(at, stated, felt, p)
        value = applied(at.C, stated) - felt / (1.0 + p[3])
        value += X[:, :, 5:8] @ (p[5:8] - used)
        left, slope = at.left(np.concatenate([value[:, :, None], X], axis=2))
        r, A = left[:, :, 0], left[:, :, 1:]
        Z = A
        if around:
            Z = _around(A, at)
            strong &= _strength(A, Z, at.segment) > LEAST_STRENGTH
            A, Z = A * strong, Z * strong
        sigma = sigma_mps or max(float(sd_about_zero(r)), 1e-4)
        size = np.sqrt((r**2).sum(axis=1)) / (sigma * np.sqrt(3.0))
        weight = np.where(size > HUBER, HUBER / np.maximum(size, 1e-12), 1.0)
        weighted = (weight / sigma**2)[:, None, None] * Z
        normal = weighted.reshape(-1, SIZE).T @ A.reshape(-1, SIZE) + np.diag(sd0**-2)
        scores = np.einsum("pki,pk->pi", weighted, r)
        last = _Pass(
            at, p, sigma, r, r + left[:, :, 4] * (1.0 + p[3]), slope[:, :, 0], size, weight, normal, scores
        )
        step = -np.linalg.solve(normal, scores.sum(axis=0) + p / sd0**2) * strong
        p = p + np.clip(step, -_LARGEST, _LARGEST)
        p[3] = max(p[3], -0.9)
    if last is None:
        return None
    member = correlation_blocks(last.scores) if around else last.at.segment
    sd = _sd(last.normal, last.scores, member, strong.sum() if around else 0)
    return last.match(M, sd, sd0, len(np.unique(member)))


@dataclass(frozen=True, eq=False)
class _Pass:
    """A pass of the fit: the integrals, its parameters before the step (14,) and what they leave.

    Attributes:
        sigma_mps: of a ping and axis.
        left, signal: (p, 3) residuals, and what the parameters but the scale leave of the velocity.
        slope: (s, 3) of the lines.
        size, weight: (p,) residuals over sigma, and their weight.
        normal, scores: (14, 14) matrix and (p, 14) right sides of the step.
    """

    at: AtPings
    values: Floats
    sigma_mps: float
    left: Floats
    signal: Floats
    slope: Floats
    size: Floats
    weight: Floats
    normal: Floats
    scores: Floats

    def match(self, axes: Floats, sd: Floats, prior_sd: Floats, blocks: int) -> Match:
        """The result, were it the last pass."""
        at, r, weight = self.at, self.left, self.weight
        loss = np.where(self.size > HUBER, HUBER * (2.0 * self.size - HUBER), self.size**2)
        gravity = np.linalg.norm(self.slope, axis=1)
        return Match(
            axes=axes, values=self.values, sd=sd,
            cost=float(3.0 * loss.sum() + ((self.values / prior_sd) ** 2).sum()), sigma_mps=self.sigma_mps,
            gravity_mps2=gravity, level_p=self.slope / np.maximum(gravity, 1e-9)[:, None],
            begins_ns=at.begins_ns, pings=int(at.kept.sum()), blocks=blocks,
            residual_mps=sd_about_median(np.einsum("pji,pj->pi", at.C, r), axis=0),
            explained=1.0 - float((weight @ r**2).sum() / max((weight @ self.signal**2).sum(), 1e-12)),
            rate_rms_radps=np.sqrt((at.omega**2).mean(axis=0)),
        )  # fmt: skip


_LARGEST = np.array([0.5] * 3 + [0.5, 0.5] + [0.05] * 3 + [1.0] * 3 + [2.0] * 3)
"""Largest change in a pass."""


def _around(columns: Floats, at: AtPings) -> Floats:
    """(p, 3, 14) means of the derivatives some pings before and after, of the same segment."""
    lag = max(1, round(AROUND_S / max(float(np.median(np.diff(at.time_s))), 1e-3)))
    summed, count = np.zeros_like(columns), np.zeros(len(columns))
    before, after = slice(None, -lag), slice(lag, None)
    near = at.segment[before] == at.segment[after]
    for one, other in ((before, after), (after, before)):
        summed[one] += np.where(near[:, None, None], columns[other], 0.0)
        count[one] += near
    return np.asarray(summed / np.maximum(count, 1.0)[:, None, None])


def _strength(columns: Floats, around: Floats, segment: Integers) -> Floats:
    """(14,) slopes of derivatives on those around, in standard deviations; infinite where they agree."""
    along, size = np.einsum("pki,pki->i", around, columns), np.einsum("pki,pki->i", around, around)
    slope = np.divide(along, size, out=np.zeros_like(along), where=size > 0.0)
    sd = np.sqrt(
        (_sums(np.einsum("pki,pki->pi", around, columns - slope * around), segment) ** 2).sum(axis=0)
    )
    return np.asarray(
        np.divide(along, sd, out=np.where(along > 0.0, np.inf, 0.0), where=sd > 1e-9 * np.abs(along))
    )


def _sums(scores: Floats, member: Integers) -> Floats:
    """Sums of scores (p, 14) over the parts that pings (p,) are members of."""
    return np.asarray(np.stack([np.bincount(member, column) for column in scores.T], axis=1))


def _sd(normal: Floats, scores: Floats, member: Integers, fitted: int) -> Floats:
    """1 sigma: the larger of that of independent residuals and that of independent parts.

    As many sums of scores are zero as there are parameters that no prior holds: `fitted`.
    """
    inverse = np.linalg.inv(normal)
    summed = _sums(scores, member)
    spare = len(summed) / max(len(summed) - fitted, 1)
    sandwich = inverse @ (spare * summed.T @ summed) @ inverse.T
    return np.asarray(np.sqrt(np.maximum(np.abs(np.diag(inverse)), np.diag(sandwich))))
