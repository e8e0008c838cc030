"""Axes and clock of an IMU against a recorded attitude, by the rotations in both."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from bottomlock.audit.logs import Reference
from bottomlock.audit.robust import Array, fit_linear, sigma
from bottomlock.recordings.streams import Inertial
from bottomlock.statistics.rms import rms

STEP_S = 0.05
"""Of the search of the offset, and of the derivative by it."""
PASSES = 4


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
    angle = cumulative_trapezoid(imu.omega_p_radps, own_s, axis=0, initial=0.0)

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

    offset = float(min(np.arange(-2.5, 2.51, STEP_S), key=cost))
    for _ in range(PASSES):
        matrix = matrix_of(offset)
        left = wanted - imu_rate(offset) @ matrix.T
        change = (imu_rate(offset + STEP_S) - imu_rate(offset - STEP_S)) @ matrix.T / (2.0 * STEP_S)
        left, change = left - left.mean(axis=0), change - change.mean(axis=0)
        # One row an instant: what is left along the derivative, whose size is then the only column.
        size = np.maximum(np.linalg.norm(change, axis=1), 1e-12)
        fit = fit_linear(size[:, None], np.einsum("ni,ni->n", change, left)[:, None] / size[:, None])
        offset += float(fit.parameters[0, 0])
    return ImuAlignment(
        offset, float(np.std(fit.resampled[:, 0, 0])), matrix, float(rms(wanted - wanted.mean(axis=0))),
        sigma(left), fit.blocks,
    )  # fmt: skip
