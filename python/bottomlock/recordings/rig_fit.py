"""What has to be changed so that a velocity follows the inertial readings: mounting, scale, clock, biases, lever arm.

With v_s the velocity as stated, in platform axes and on the stated clock, the velocity of the IMU at the time t + τ is

    v = (1 + s) exp(ρ) M v_s(t) − ω × l

with M a signed permutation of the axes. Its departure from the line of `segments` gives every parameter by least
squares (Gauss-Newton, Huber's loss). A prior of each parameter states how far it may be from zero.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bottomlock.recordings.rig_segments import LEAST_PINGS, AtPings, applied, at_pings, integrate, lines
from bottomlock.recordings.robust import sd_about_zero
from bottomlock.recordings.rotation import rotation_matrices
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


@dataclass(frozen=True, eq=False)
class Recorded:
    """Inertial readings in platform axes, and velocities as stated: times (p,) and (p, 3) in m/s."""

    inertial: Inertial
    time_ns: Integers
    velocity_p_mps: Floats

    def with_gyros(self, factor: float | Floats) -> "Recorded":
        """The same with the rates multiplied, all alike or each axis (3,) by its own."""
        return replace(
            self, inertial=replace(self.inertial, omega_p_radps=factor * self.inertial.omega_p_radps)
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
    def rotation(self) -> Floats:
        """(3, 3) from the velocity's axes as stated, after `axes`, to the platform's."""
        return rotation_matrices(self.part("rotation"))

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


def _skew(v: Floats) -> Floats:
    """[v×] of vectors (p, 3)."""
    matrix = np.zeros((len(v), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[:, j, i], matrix[:, i, j] = v[:, k], -v[:, k]
    return matrix


def _columns(at: AtPings, stated: Floats, felt: Floats, scale: float) -> Floats:
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
    columns[:, :, 4] = applied(at.C, applied(omega_cross, stated) - k * at.force)
    columns[:, :, 5:8] = k * at.K + _skew(applied(at.C, stated)) @ at.J
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
) -> Match | None:
    """Fits the parameters; None where the recording has too few pings in whole segments.

    Args:
        recorded: readings and velocities.
        prior: 1 sigma of each of `PARTS` about zero.
        free: those of which nothing is known, as `LOOSE` has it.
        axes: (3, 3) M; the identity by default.
        clock_s: clock offset to begin from.
        sigma_mps: of a ping and axis, for costs that are compared; estimated by default.
    """
    M = np.eye(3) if axes is None else axes
    p = np.zeros(SIZE)
    p[4] = clock_s
    sd0 = np.concatenate(
        [
            np.full(part.stop - part.start, (LOOSE if name in free else prior)[name])
            for name, part in PARTS.items()
        ]
    )
    used = np.zeros(3)
    segments = integrate(recorded.inertial)
    if segments is None:
        return None
    length_s = float(segments.time_ns[0, -1] - segments.time_ns[0, 0]) * 1e-9
    sigma = sigma_mps
    result = None
    for _ in range(PASSES):
        if float(np.abs(p[5:8] - used).max()) * length_s > REINTEGRATED_RAD:
            used = p[5:8].copy()
            segments = integrate(recorded.inertial, gyro_bias_radps=used)
            assert segments is not None  # the same readings as before
        at = at_pings(segments, recorded.time_ns + round(float(p[4]) * 1e9))
        if at.kept.sum() < 4 * LEAST_PINGS:
            return result
        stated = recorded.velocity_p_mps[at.kept] @ (rotation_matrices(p[:3]) @ M).T
        felt = applied(at.C, _skew(at.omega) @ p[11:14]) + at.S - at.J @ p[8:11]
        X = _columns(at, stated, felt, float(p[3]))
        value = applied(at.C, stated) - felt / (1.0 + p[3])
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
