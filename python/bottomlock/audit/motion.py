"""Attitude, angular rate and velocity of the platform at any time, from the other recordings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from bottomlock.audit.logs import Reference
from bottomlock.audit.robust import Array, fit_nonlinear
from bottomlock.recordings.streams import Inertial
from bottomlock.statistics.rms import rms

SLOW_S = 0.3
"""Attitude at longer steps is interpolated by a smooth spline, at shorter ones by shortest arcs (slerp)."""


def integral(values: Array, time_s: Array) -> Array:
    """(n, ...) integral of samples (n, ...) from the first time on, by the trapezoidal rule.

    A plain sum would be half a step late: 5 ms at 1°/s tilts gravity by 1 mm/s².
    """
    return np.asarray(cumulative_trapezoid(values, time_s, axis=0, initial=0.0))


def _running_product(angles: Array) -> Rotation:
    """Attitude after each of the rotation increments (n, 3), rad, from the identity: n products in log n passes."""
    increments = Rotation.from_rotvec(angles).as_quat()
    shift = 1
    while shift < len(increments):
        joined = Rotation.from_quat(increments[:-shift]) * Rotation.from_quat(increments[shift:])
        increments[shift:] = joined.as_quat()
        shift *= 2
    return Rotation.from_quat(increments)


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
    """Motion of the platform from the reference, on the reference's clock in seconds from `zero_ns`.

    The angular rate is the IMU's where there is one (its clock corrected by `imu_offset_s`), else the attitude's.
    """

    def __init__(
        self, reference: Reference, imu: Inertial | None, *, zero_ns: int, imu_offset_s: float = 0.0
    ) -> None:
        self.time_s = np.asarray((reference.time_ns - zero_ns) * 1e-9)
        attitudes = Rotation.from_euler("ZYX", reference.rpy_rad[:, ::-1])
        slow = float(np.median(np.diff(self.time_s))) > SLOW_S
        self._attitude: RotationSpline | Slerp | _Product = (
            RotationSpline(self.time_s, attitudes) if slow else Slerp(self.time_s, attitudes)
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
        """Attitude from the gyro's increments, with a slow correction to the reference's attitude.

        Roll and pitch between the samples of a slow reference would otherwise be missed, and gravity would integrate
        that error to a velocity.
        """
        assert self._imu_s is not None
        own = self._imu_s - self._imu_offset_s
        gyro = Slerp(own, _running_product(angles))
        covered = (self.time_s >= own[0]) & (self.time_s <= own[-1])
        knots = self.time_s[covered]
        correction = Slerp(knots, self._attitude(knots) * gyro(knots).inv())
        self._fine_s = (float(knots[0]), float(knots[-1]))
        self._attitude = _Product(correction, gyro, self._fine_s)

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

    def omega_tp_p_radps(self, time_s: Array) -> Array:
        """(n, 3) angular rate against the tangent frame, mean over 0.2 s (the Earth's rate is negligible here)."""
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
    """Alignment of the IMU's angular rates with those of the recorded attitude.

    `offset_s` is IMU time minus attitude time of the same instant; `matrix` (3, 3) maps IMU axes to platform axes (a
    negative diagonal entry is a reversed axis).
    """

    offset_s: float
    offset_sd_s: float
    matrix: Array
    rate_rms_radps: float
    residual_radps: float
    blocks: int


def align_imu(reference: Reference, imu: Inertial) -> ImuAlignment | None:
    """Clock offset and axes of the IMU from its rates against the attitude's; None from less than 30 s in common."""
    zero = int(reference.time_ns[0])
    time_s = np.asarray((reference.time_ns - zero) * 1e-9, dtype=np.float64)
    own_s = np.asarray((imu.time_ns - zero) * 1e-9, dtype=np.float64)
    stride = max(1, round(0.5 / float(np.median(np.diff(time_s)))))
    edges = time_s[::stride]
    edges = edges[(edges > own_s[0] + 3.0) & (edges < own_s[-1] - 3.0)]
    if len(edges) < 60 or edges[-1] - edges[0] < 30.0:
        return None
    picked = np.isin(time_s, edges)
    attitudes = Rotation.from_euler("ZYX", reference.rpy_rad[picked][:, ::-1])
    span = np.diff(edges)[:, None]
    wanted = (attitudes[:-1].inv() * attitudes[1:]).as_rotvec() / span
    angle = integral(imu.omega_p_radps, own_s)

    def imu_rate(offset: float) -> Array:
        at = np.stack([np.interp(edges + offset, own_s, column) for column in angle.T], axis=1)
        return np.asarray(np.diff(at, axis=0) / span)

    def matrix_of(offset: float) -> Array:
        X = imu_rate(offset)
        X = X - X.mean(axis=0)
        return np.asarray(np.linalg.lstsq(X, wanted - wanted.mean(axis=0), rcond=None)[0].T)

    def cost(offset: float) -> float:
        X = imu_rate(offset)
        off = (wanted - wanted.mean(axis=0)) - (X - X.mean(axis=0)) @ matrix_of(offset).T
        return float(np.median(np.sum(off**2, axis=1)))

    grid = np.linspace(-2.5, 2.5, 101)
    start = float(grid[np.argmin([cost(value) for value in grid])])
    best = minimize_scalar(cost, bounds=(start - 0.06, start + 0.06), method="bounded")
    matrix = matrix_of(float(best.x))

    def residuals(p: Array) -> Array:
        return np.asarray(wanted - imu_rate(float(p[0])) @ matrix.T - p[1:4])

    wide = np.array([5.0, 0.1, 0.1, 0.1])
    fit = fit_nonlinear(
        residuals, np.array([best.x, 0.0, 0.0, 0.0]), scale=np.array([0.01, 1e-4, 1e-4, 1e-4]), prior_sd=wide
    )
    return ImuAlignment(
        float(fit.parameters[0]), float(np.sqrt(fit.cov[0, 0])), matrix,
        float(rms(wanted - wanted.mean(axis=0))), fit.residual_sigma, fit.blocks,
    )  # fmt: skip
