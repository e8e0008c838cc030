"""Mounting of the DVL: misalignment, lever arm, scale and clock offset, from its velocity and other recordings.

With v_n and attitude C of the platform and its rate ω, all at the time t + τ on the reference's clock,

    v_d(t) = (1 + s) R_pdᵀ (Cᵀ v_n + ω × l)                                   (with a recorded velocity)
    Δ[C (R_pd v_d / (1 + s) − ω × l)] = ∫ (C (f − b) + g + a) dt               (with a recorded IMU and attitude)

where R_pd rotates DVL axes to platform axes, l is the lever arm from the reference point to the DVL, b an
accelerometer bias and a a constant levelling error in the tangent frame. The second form needs accelerations and
rotations: a parameter that the motion does not excite keeps the spread of its wide prior and is not observable.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.audit.logs import Reference
from bottomlock.audit.motion import ImuAlignment, Motion, align_imu, integral
from bottomlock.audit.robust import (
    LEAST_BLOCKS,
    Array,
    NonlinearFit,
    are_strong,
    fit_nonlinear,
    jacobian,
    sigma,
)
from bottomlock.recordings.streams import Inertial
from bottomlock.statistics.rms import rms

Rows = NDArray[np.int64]
Residuals = Callable[[Array], Array]
"""Parameters (p,) to residuals (n, k), or to derivatives of them (n, k, p)."""

GRAVITY_MPS2 = 9.81
BY_VELOCITY, BY_IMU = "velocity and attitude beside the log", "IMU and attitude beside the log"
"""Sources of a mounting."""
WINDOW_S = 2.0
QUIET_S = 6.0
"""Pings for so long on each side of a window, and its length away from it, give its ends a velocity of other noise."""
REACH_S = 3.0
"""Clock offsets are searched within ± this."""
_OFFSETS_S = np.arange(-REACH_S, REACH_S + 0.1, 0.25)

LIMITS = {"misalignment_rad": np.deg2rad(1.0), "lever_arm_m": 0.3, "clock_offset_s": 0.1, "scale": 0.02}
"""A parameter with a larger standard deviation is not observable; a lever arm or scale may be significant beyond it."""
LEAST_EXPLAINED = 0.5
"""Nothing is observable in a log of whose velocity the other recordings explain a smaller fraction."""
GAIN_SD = 0.05
"""... or of whose changes, often noise for the most part, the response to the IMU is less certain; it is 1 for the same
motion, 0 for another."""


@dataclass(frozen=True, eq=False)
class Mounting:
    """Mounting parameters of the DVL with their standard deviations.

    Attributes:
        source: recordings that it was estimated from.
        rpy_rad: (3,) roll, pitch, yaw from DVL axes to platform axes.
        misalignment_sd_rad: (3,) about the platform's x, y, z.
        lever_arm_p_m, lever_arm_sd_m: (3,) from the reference's point to the DVL.
        clock_offset_s, clock_offset_sd_s: reference time minus DVL time of the same instant.
        scale, scale_sd: the DVL reads (1 + scale) times the velocity.
        mirrored: the DVL's velocity fits only with its y axis reversed: the frame is left-handed.
        residual_mps: (3,) robust sigma per axis.
        explained: fraction of the mean square of the velocity (or of its changes) that the fit explains, 0 to 1.
        instants: number of pings or windows.
        blocks: number of independent blocks behind the standard deviations.
        rate_rms_radps: (3,) RMS angular rate of the platform.
        imu: alignment of the IMU with the attitude, or None.
    """

    source: str
    rpy_rad: Array
    misalignment_sd_rad: Array
    lever_arm_p_m: Array
    lever_arm_sd_m: Array
    clock_offset_s: float
    clock_offset_sd_s: float
    scale: float
    scale_sd: float
    mirrored: bool
    residual_mps: Array
    explained: float
    instants: int
    blocks: int
    rate_rms_radps: Array
    imu: ImuAlignment | None = None

    @property
    def of_changes(self) -> bool:
        """From changes of the velocity against the IMU, else from the velocity itself."""
        return self.source == BY_IMU

    @property
    def follows(self) -> bool:
        """The other recordings explain enough of the velocity for the parameters to be observable."""
        certain = self.scale_sd < GAIN_SD if self.of_changes else self.explained > LEAST_EXPLAINED
        return certain and abs(self.scale) < 0.2


_KEPT_OFFSETS = 8
"""Clock offsets whose motion is kept: in a gradient by differences all other parameters share one."""

MIRROR = np.diag([1.0, -1.0, 1.0])
CLEARLY = 0.8
"""Ratio of the costs below which a frame upside down or mirrored is taken."""
_FRAMES = [
    Rotation.from_euler("ZX", [yaw, roll], degrees=True).as_matrix() @ mirror
    for mirror, roll, yaw in itertools.product((np.eye(3), MIRROR), (0.0, 180.0), range(0, 360, 15))
]


def _unusual(frame: int) -> int:
    """0 for a frame that is upright, 1 for one upside down, 2 for a mirrored one."""
    return min(4 * frame // len(_FRAMES), 2)


def find_mounting(
    time_ns: NDArray[np.int64], velocity_d_mps: Array, reference: Reference, imu: Inertial | None
) -> Mounting | None:
    """Estimates misalignment, lever arm, clock offset and scale of the instrument's velocity (n, 3) at times (n,), ns.

    Uses the reference's velocity where there is one, otherwise the IMU. Returns None without either, or where the
    recordings overlap by fewer than 50 pings.
    """
    if reference.velocity_t_mps is None and imu is None:
        return None
    zero = int(time_ns[0])
    time_s = np.asarray((time_ns - zero) * 1e-9)
    aligned = None if imu is None else align_imu(reference, imu)
    offset = 0.0 if aligned is None else aligned.offset_s
    # The gyro is used only where its axes agree with those of the attitude.
    usable = imu if aligned is None or np.abs(aligned.matrix - np.eye(3)).max() < 0.2 else None
    motion = Motion(reference, usable, zero_ns=zero, imu_offset_s=offset)
    inside = motion.within(time_s, REACH_S + 0.5)
    if inside.sum() < 50:
        return None
    time_s, velocity = time_s[inside], velocity_d_mps[inside]
    if reference.velocity_t_mps is not None:
        return _against_velocity(time_s, velocity, motion, aligned)
    if usable is None:
        return None
    return _against_imu(time_s, velocity, motion, usable, zero_ns=zero, offset_s=offset, aligned=aligned)


def _coarse(cost: Callable[[Array, float], float]) -> tuple[Array, float]:
    """Best initial rotation and clock offset, over rotations about z, frames upside down and mirrored frames."""
    found = [
        (cost(matrix, float(offset)), k, abs(float(offset)), float(offset))
        for k, matrix in enumerate(_FRAMES)
        for offset in _OFFSETS_S
    ]
    chosen = min(one for one in found if _unusual(one[1]) == 0)
    # A frame upside down or mirrored must fit clearly better: a velocity ahead or in a plane fits it as well.
    for unusual in (1, 2):
        other = min(one for one in found if _unusual(one[1]) == unusual)
        if other[0] < CLEARLY * chosen[0]:
            chosen = other
    return _FRAMES[chosen[1]], chosen[3]


def _against_velocity(
    time_s: Array, velocity: Array, motion: Motion, aligned: ImuAlignment | None
) -> Mounting:
    few = slice(None, None, max(1, len(time_s) // 400))
    cache = {float(offset): motion.velocity_p_mps(time_s[few] + offset) for offset in _OFFSETS_S}

    def cost(matrix: Array, offset: float) -> float:
        # The mean, not the median: what a vehicle shows of its clock is in its few turns.
        return float(np.mean(np.linalg.norm(velocity[few] @ matrix.T - cache[offset], axis=1)))

    @lru_cache(maxsize=_KEPT_OFFSETS)
    def moved(offset_s: float) -> tuple[Array, Array]:
        at = time_s + offset_s
        return motion.velocity_p_mps(at), motion.omega_tp_p_radps(at)

    def read(p: Array, velocity_p: Array, omega_p: Array) -> Array:
        model = velocity_p + np.cross(omega_p, p[3:6])
        return np.asarray((1.0 + p[7]) * Rotation.from_rotvec(p[:3]).inv().apply(model))

    scale = np.array([0.01] * 3 + [0.1] * 3 + [0.05, 0.01])
    prior = np.array([1.0] * 3 + [5.0] * 3 + [2.0, 0.3])
    steps = _steps(scale, motion)

    def about(frame: Array) -> tuple[Residuals, Residuals]:
        rotated = velocity @ frame.T

        def residuals(p: Array) -> Array:
            return rotated - read(p, *moved(float(p[6])))

        def instruments(p: Array) -> Array:
            """Derivatives at the motion around a ping, whose noise is another; of the clock, over twice the time."""
            around = [moved(float(p[6] + side * steps[6])) for side in (-1.0, 1.0)]
            velocity_p, omega_p = (np.mean(pair, axis=0) for pair in zip(*around, strict=True))
            Z = jacobian(lambda q: -read(q, velocity_p, omega_p), p, steps)
            wide = np.zeros_like(p)
            wide[6] = 2.0 * steps[6]
            Z[:, :, 6] = (residuals(p + wide) - residuals(p - wide)) / (2.0 * wide[6])
            return Z

        return residuals, instruments

    fit, frame = _fit(about, _coarse(cost)[0], scale, prior, steps)
    rate = motion.omega_tp_p_radps(time_s + fit.parameters[6])
    return _mounting(BY_VELOCITY, fit, frame, rate, velocity, aligned)


def _fit(
    about: Callable[[Array], tuple[Residuals, Residuals]],
    frame: Array,
    scale: Array,
    prior_sd: Array,
    steps: Array,
) -> tuple[NonlinearFit, Array]:
    """The fit, and the rotation (3, 3) that its first three parameters, a rotation vector, follow on.

    Args:
        about: residuals and instrumental variables by such a rotation.
        frame: the first one.
        scale, prior_sd, steps: of the parameters.
    """
    p = _start(about(frame)[0], steps, prior_sd)
    vector = p[:3].copy()
    p[:3] = 0.0
    # About axes that are those of the platform by now, of which one, ahead, may show nothing.
    turned = Rotation.from_rotvec(vector).as_matrix() @ frame
    seen = are_strong(*about(turned), p, steps)[:3]
    turned = Rotation.from_rotvec(vector * seen).as_matrix() @ frame
    residuals, instruments = about(turned)
    fit = fit_nonlinear(residuals, p, scale=scale, prior_sd=prior_sd, steps=steps, instruments_of=instruments)
    return fit, turned


def _start(residuals_of: Callable[[Array], Array], steps: Array, prior_sd: Array) -> Array:
    """The parameters (p,) of least cost over clock offsets, the others by least squares at each.

    A wrong lever arm or angle moves the offset of the least residual to another minimum.
    """
    found = []
    for offset in _OFFSETS_S:
        p = np.zeros(len(steps))
        p[6] = offset
        others = np.arange(len(p)) != 6
        J = jacobian(residuals_of, p, steps)[:, :, others].reshape(-1, len(p) - 1)
        left = residuals_of(p).ravel()
        level = max(sigma(left), 1e-9)
        X = np.concatenate([J / level, np.diag(1.0 / prior_sd[others])])
        p[others] = -np.linalg.lstsq(X, np.concatenate([left / level, np.zeros(len(p) - 1)]), rcond=None)[0]
        found.append((float(np.mean(np.linalg.norm(residuals_of(p), axis=1))), abs(offset), p))
    return min(found, key=lambda one: one[:2])[2]


def _steps(scale: Array, motion: Motion) -> Array:
    """Steps of the derivatives; that of the clock offset (the seventh) is half a second at least, or a sample.

    A velocity of 2 mm/s noise then has a derivative of 3 mm/s² noise: less than the acceleration of a slow vehicle.
    """
    steps = 1e-4 * scale
    steps[6] = np.clip(float(np.median(np.diff(motion.time_s))), 0.5, 1.0)
    return steps


def _mounting(
    source: str,
    fit: NonlinearFit,
    frame: Array,
    rate: Array,
    signal: Array,
    aligned: ImuAlignment | None,
) -> Mounting:
    sd = np.sqrt(np.diag(fit.cov)) if fit.blocks >= LEAST_BLOCKS else np.full(len(fit.cov), np.inf)
    if abs(fit.parameters[6]) > REACH_S:
        sd[6] = np.inf
    residual = np.array([sigma(column) for column in fit.residuals.T])
    mirrored = bool(np.linalg.det(frame) < 0.0)
    proper = frame @ MIRROR if mirrored else frame
    rotation = Rotation.from_rotvec(fit.parameters[:3]) * Rotation.from_matrix(proper)
    return Mounting(
        source=source,
        rpy_rad=rotation.as_euler("ZYX")[::-1],
        misalignment_sd_rad=sd[:3],
        lever_arm_p_m=fit.parameters[3:6],
        lever_arm_sd_m=sd[3:6],
        clock_offset_s=float(fit.parameters[6]),
        clock_offset_sd_s=float(sd[6]),
        scale=float(fit.parameters[7]),
        scale_sd=float(sd[7]),
        mirrored=mirrored,
        residual_mps=residual,
        explained=_explained(fit, signal),
        instants=len(signal),
        blocks=fit.blocks,
        rate_rms_radps=rms(rate, axis=0),
        imu=aligned,
    )


def _explained(fit: NonlinearFit, signal: Array) -> float:
    """Fraction of the signal (n, k) that the fit explains, 0 to 1, with the weights of the fit.

    A robust spread of the signal would leave out the turns of a vehicle that mostly goes straight.
    """
    w = fit.weights[:, None]
    return float(np.clip(1.0 - np.sum(w * fit.residuals**2) / max(np.sum(w * signal**2), 1e-12), 0.0, 1.0))


class _Windows:
    """Integrals of the IMU over windows of the DVL's pings, as functions of the clock offset.

    The IMU's specific force is integrated once, in the tangent frame; a window's integral is a difference of two
    interpolated values.
    """

    def __init__(
        self, time_s: Array, first: Rows, last: Rows, motion: Motion, imu: Inertial, imu_s: Array
    ) -> None:
        self._imu_s, self._motion = imu_s, motion
        self._time_s, self._start_s, self._end_s = time_s, time_s[first], time_s[last]
        rotation = motion.attitude(imu_s).as_matrix()
        gravity = np.array([0.0, 0.0, GRAVITY_MPS2])
        self._velocity = integral(np.einsum("nij,nj->ni", rotation, imu.force_p_mps2) + gravity, imu_s)
        self._rotation = integral(rotation, imu_s)

    def _at(self, series: Array, time_s: Array) -> Array:
        flat = series.reshape(len(series), -1)
        columns = [np.interp(time_s, self._imu_s, column) for column in flat.T]
        return np.stack(columns, axis=1).reshape(-1, *series.shape[1:])

    def at(self, offset_s: float) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Velocity change, integral of the rotation, and attitudes and angular rates at both ends."""
        a, b = self._start_s + offset_s, self._end_s + offset_s
        change = self._at(self._velocity, b) - self._at(self._velocity, a)
        rotated = self._at(self._rotation, b) - self._at(self._rotation, a)
        attitude = self._motion.attitude
        omega = self._motion.omega_tp_p_radps
        return change, rotated, attitude(a).as_matrix(), attitude(b).as_matrix(), omega(a), omega(b)

    def quiet(self, velocity_p_mps: Array, first: Rows, last: Rows, offset_s: float) -> tuple[Array, Array]:
        """Velocities (n, 3) at both ends of each window from the pings around it, carried there by the IMU.

        They share the motion with the velocities at the ends, and none of their noise: a noise that differs between
        level and vertical would otherwise pass for a roll and pitch.
        """
        at = self._time_s + offset_s
        C, carried = self._motion.attitude(at).as_matrix(), self._at(self._velocity, at)
        constant = np.einsum("nij,nj->ni", C, velocity_p_mps) - carried
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(constant, axis=0)])
        length = int(last[0] - first[0])
        pings = max(length, round(QUIET_S / WINDOW_S * length))
        low, high = np.clip([first - length - pings, last + length + 1 + pings], 0, len(at))
        inner_low, inner_high = np.clip([first - length, last + length + 1], 0, len(at))
        count = (inner_low - low) + (high - inner_high)
        mean = (sums[inner_low] - sums[low] + sums[high] - sums[inner_high]) / np.maximum(count, 1)[:, None]
        return tuple(np.einsum("nji,nj->ni", C[k], mean + carried[k]) for k in (first, last))


def _window_rows(time_s: Array) -> tuple[Rows, Rows]:
    """First and last ping of overlapping windows of `WINDOW_S`, without those over a gap of the log."""
    step = float(np.median(np.diff(time_s)))
    length, hop = max(1, round(WINDOW_S / step)), max(1, round(0.5 * WINDOW_S / step))
    first = np.arange(0, len(time_s) - length, hop)
    # Over a gap the window would depend on the IMU alone for too long.
    first = first[time_s[first + length] - time_s[first] < 1.5 * length * step]
    return first, first + length


def _against_imu(
    time_s: Array, velocity: Array, motion: Motion, imu: Inertial,
    *, zero_ns: int, offset_s: float, aligned: ImuAlignment | None,
) -> Mounting | None:  # fmt: skip
    """Mounting from velocity changes over windows against the integrated specific force."""
    first, last = _window_rows(time_s)
    if len(first) < 25:
        return None
    imu_s = np.asarray((imu.time_ns - zero_ns) * 1e-9) - offset_s
    windows = _Windows(time_s, first, last, motion, imu, imu_s)
    known = {float(offset): windows.at(float(offset)) for offset in _OFFSETS_S}
    span = (time_s[last] - time_s[first])[:, None]

    def cost(matrix: Array, offset: float) -> float:
        change, rotated, C_a, C_b, _, _ = known[offset]
        v = velocity @ matrix.T
        gap = np.einsum("nij,nj->ni", C_b, v[last]) - np.einsum("nij,nj->ni", C_a, v[first]) - change
        X = rotated.reshape(-1, 3)
        bias = np.linalg.lstsq(X, gap.ravel(), rcond=None)[0]
        return float(np.mean(np.linalg.norm(gap - (X @ bias).reshape(-1, 3), axis=1)))

    at = lru_cache(maxsize=_KEPT_OFFSETS)(windows.at)

    def gaps(p: Array, before: Array, after: Array) -> Array:
        change, rotated, C_a, C_b, omega_a, omega_b = at(float(p[6]))
        turned = Rotation.from_rotvec(p[:3])
        v_a = turned.apply(before) / (1.0 + p[7]) - np.cross(omega_a, p[3:6])
        v_b = turned.apply(after) / (1.0 + p[7]) - np.cross(omega_b, p[3:6])
        gap = np.einsum("nij,nj->ni", C_b, v_b) - np.einsum("nij,nj->ni", C_a, v_a) - change
        level = np.concatenate([p[11:13], [0.0]])
        gap = gap + np.einsum("nij,j->ni", rotated, p[8:11]) - level * span
        # In the DVL's own scale: otherwise a larger scale would reduce the DVL's noise and so the cost.
        return np.asarray((1.0 + p[7]) * gap)

    scale = np.array([0.01] * 3 + [0.1] * 3 + [0.05, 0.01] + [0.01] * 5)
    prior = np.array([1.0] * 3 + [5.0] * 3 + [2.0, 0.3] + [0.3] * 3 + [0.1] * 2)
    steps = _steps(scale, motion)
    start, first_offset = _coarse(cost)

    def about(frame: Array) -> tuple[Residuals, Residuals]:
        rotated = velocity @ frame.T
        ends, quiet = (rotated[first], rotated[last]), windows.quiet(rotated, first, last, first_offset)
        return (
            lambda p: gaps(p, *ends),
            lambda p: jacobian(lambda q: gaps(q, *quiet), p, 2.0 * steps),
        )

    fit, frame = _fit(about, start, scale, prior, steps)
    omega = motion.omega_tp_p_radps(time_s + fit.parameters[6])
    return _mounting(BY_IMU, fit, frame, omega, velocity[last] - velocity[first], aligned)
