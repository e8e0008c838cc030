"""Attitude, rate and velocity of the platform at any time, from what was recorded beside the log."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from bottomlock.audit.logs import Inertial, Reference
from bottomlock.audit.robust import Array, fit_nonlinear
from bottomlock.statistics.rms import rms

SLOW_S = 0.3
"""Attitude in steps longer than this is joined by a smooth spline, in shorter ones by shortest arcs."""


def integral(values: Array, time_s: Array) -> Array:
    """(n, ...) integral of samples (n, ...) from the first time on, by trapezia.

    Plain sums would be half a step late: 5 ms at a turn of 1°/s lean gravity by 1 mm/s².
    """
    return np.asarray(cumulative_trapezoid(values, time_s, axis=0, initial=0.0))


def _running_product(angles: Array) -> Rotation:
    """Attitude after each of the small turns (n, 3), from the identity: n products in log n passes."""
    turns = Rotation.from_rotvec(angles).as_quat()
    shift = 1
    while shift < len(turns):
        joined = Rotation.from_quat(turns[:-shift]) * Rotation.from_quat(turns[shift:])
        turns[shift:] = joined.as_quat()
        shift *= 2
    return Rotation.from_quat(turns)


@dataclass(frozen=True, eq=False)
class _Product:
    """A slow rotation times a fast one, over the times that both cover."""

    slow: Slerp
    fast: Slerp
    span_s: tuple[float, float]

    def __call__(self, time_s: Array) -> Rotation:
        at = np.clip(time_s, *self.span_s)
        return self.slow(at) * self.fast(at)


class Motion:
    """The platform as the reference has it, on the reference's clock in seconds from `zero_ns`.

    The rate comes from the IMU where there is one (its clock put right by `imu_offset_s`), from the attitude else.
    """

    def __init__(
        self, reference: Reference, imu: Inertial | None, *, zero_ns: int, imu_offset_s: float = 0.0
    ) -> None:
        self.time_s = np.asarray((reference.time_ns - zero_ns) * 1e-9)
        turns = Rotation.from_euler("ZYX", reference.rpy_rad[:, ::-1])
        slow = float(np.median(np.diff(self.time_s))) > SLOW_S
        self._attitude: RotationSpline | Slerp | _Product = (
            RotationSpline(self.time_s, turns) if slow else Slerp(self.time_s, turns)
        )
        self._velocity = (
            None if reference.velocity_t_mps is None else CubicSpline(self.time_s, reference.velocity_t_mps)
        )
        self._imu_s: Array | None = None
        if imu is not None:
            self._imu_s = np.asarray((imu.time_ns - zero_ns) * 1e-9)
            self._imu_offset_s = imu_offset_s
            self._angle = integral(imu.omega_p_radps, self._imu_s)
            self._join(np.diff(self._angle, axis=0, prepend=np.zeros((1, 3))))

    def _join(self, angles: Array) -> None:
        """Attitude from the gyro's turns, led back to the reference's by a correction that changes slowly.

        Between the attitudes of a slow reference the vehicle rolls and pitches; gravity turns what is missed into
        velocity.
        """
        assert self._imu_s is not None
        own = self._imu_s - self._imu_offset_s
        turned = Slerp(own, _running_product(angles))
        covered = (self.time_s >= own[0]) & (self.time_s <= own[-1])
        knots = self.time_s[covered]
        correction = Slerp(knots, self._attitude(knots) * turned(knots).inv())
        self._fine_s = (float(knots[0]), float(knots[-1]))
        self._attitude = _Product(correction, turned, self._fine_s)

    def within(self, time_s: Array, margin_s: float) -> NDArray[np.bool_]:
        """(n,) the reference (and the IMU) cover this time and `margin_s` around it."""
        low, high = self.time_s[0] + margin_s, self.time_s[-1] - margin_s
        if self._imu_s is not None:
            low = max(low, self._imu_s[0] - self._imu_offset_s + margin_s)
            high = min(high, self._imu_s[-1] - self._imu_offset_s - margin_s)
        return np.asarray((time_s >= low) & (time_s <= high))

    def attitude(self, time_s: Array) -> Rotation:
        """Platform to tangent at times (n,)."""
        return self._attitude(np.clip(time_s, self.time_s[0], self.time_s[-1]))

    def velocity_p_mps(self, time_s: Array) -> Array:
        """(n, 3) velocity in the platform frame at times (n,)."""
        assert self._velocity is not None
        return np.asarray(self.attitude(time_s).inv().apply(self._velocity(time_s)))

    def rate_p_radps(self, time_s: Array) -> Array:
        """(n, 3) rate against the tangent frame (the Earth's own rate is far below what matters here), over 0.2 s."""
        half = 0.1
        if self._imu_s is None:
            before, after = self.attitude(time_s - half), self.attitude(time_s + half)
            return np.asarray((before.inv() * after).as_rotvec() / (2.0 * half))
        own = time_s + self._imu_offset_s
        columns = [
            np.interp(own + half, self._imu_s, angle) - np.interp(own - half, self._imu_s, angle)
            for angle in self._angle.T
        ]
        return np.stack(columns, axis=1) / (2.0 * half)


@dataclass(frozen=True, eq=False)
class ImuAlignment:
    """How the IMU's turns compare with those of the attitude beside it.

    `offset_s` is IMU time minus attitude time of the same instant, `matrix` (3, 3) takes IMU axes to platform axes (a
    sign on its diagonal is an axis that points the other way).
    """

    offset_s: float
    offset_sd_s: float
    matrix: Array
    rate_rms_radps: float
    residual_radps: float


def align_imu(reference: Reference, imu: Inertial) -> ImuAlignment | None:
    """Clock offset and axes of the IMU from its turns against the attitude's; None from less than 30 s in common."""
    zero = int(reference.time_ns[0])
    time_s = np.asarray((reference.time_ns - zero) * 1e-9, dtype=np.float64)
    own_s = np.asarray((imu.time_ns - zero) * 1e-9, dtype=np.float64)
    stride = max(1, round(0.5 / float(np.median(np.diff(time_s)))))
    edges = time_s[::stride]
    edges = edges[(edges > own_s[0] + 3.0) & (edges < own_s[-1] - 3.0)]
    if len(edges) < 60 or edges[-1] - edges[0] < 30.0:
        return None
    picked = np.isin(time_s, edges)
    turns = Rotation.from_euler("ZYX", reference.rpy_rad[picked][:, ::-1])
    span = np.diff(edges)[:, None]
    wanted = (turns[:-1].inv() * turns[1:]).as_rotvec() / span
    angle = integral(imu.omega_p_radps, own_s)

    def turned(offset: float) -> Array:
        at = np.stack([np.interp(edges + offset, own_s, column) for column in angle.T], axis=1)
        return np.asarray(np.diff(at, axis=0) / span)

    def matrix_of(offset: float) -> Array:
        X = turned(offset)
        X = X - X.mean(axis=0)
        return np.asarray(np.linalg.lstsq(X, wanted - wanted.mean(axis=0), rcond=None)[0].T)

    def cost(offset: float) -> float:
        X = turned(offset)
        off = (wanted - wanted.mean(axis=0)) - (X - X.mean(axis=0)) @ matrix_of(offset).T
        return float(np.median(np.sum(off**2, axis=1)))

    grid = np.linspace(-2.5, 2.5, 101)
    start = float(grid[np.argmin([cost(value) for value in grid])])
    best = minimize_scalar(cost, bounds=(start - 0.06, start + 0.06), method="bounded")
    matrix = matrix_of(float(best.x))

    def residuals(p: Array) -> Array:
        return np.asarray(wanted - turned(float(p[0])) @ matrix.T - p[1:4])

    wide = np.array([5.0, 0.1, 0.1, 0.1])
    fit = fit_nonlinear(
        residuals, np.array([best.x, 0.0, 0.0, 0.0]), scale=np.array([0.01, 1e-4, 1e-4, 1e-4]), prior_sd=wide
    )
    return ImuAlignment(
        float(fit.parameters[0]), float(np.sqrt(fit.cov[0, 0])), matrix,
        float(rms(wanted - wanted.mean(axis=0))), fit.residual_sigma,
    )  # fmt: skip
