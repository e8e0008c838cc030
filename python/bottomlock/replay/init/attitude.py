"""What a recorded attitude is: unit, frames and clock, by comparing its own rate with the gyros."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.recordings.axes import from_angles, platform_attitude

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
LAGS_S = 3.0
LAG_STEP_S = 0.05
LEVEL = 0.5
"""Correlation of roll and pitch rates from which they tell how an attitude sensor stands."""
OFF_QUARTER_DEG = 20.0


@dataclass(frozen=True)
class AttitudeMatch:
    """How an attitude compares with gyros.

    Attributes:
        frame: "ned_frd" or "enu_flu".
        correlation: of the rates, at the best clock offset.
        other: correlation of the other frame.
        slope: of the attitude's rate over the gyros': 1, or a wrong unit.
        offset_s: to add to the attitude's times.
        least: smallest correlation of a single axis that turns enough to tell.
        quarters: of a turn, from the attitude sensor's forward to starboard, by which its axes stand on the platform.
        level: correlation of roll and pitch rates at that turn.
    """

    frame: str
    correlation: float
    other: float
    slope: float
    offset_s: float
    least: float
    quarters: int = 0
    level: float = 0.0

    @property
    def clear(self) -> bool:
        """Whether the rates decide."""
        return self.correlation > 0.4 and self.correlation > self.other + 0.1


def match_attitude(
    time_ns: Integers, rpy_rad: Floats, imu_time_ns: Integers, omega_p_radps: Floats
) -> AttitudeMatch | None:
    """Compares an attitude with gyros, in both frames and at every clock offset of a few seconds.

    Args:
        time_ns, rpy_rad: (n,), (n, 3).
        imu_time_ns, omega_p_radps: (m,), (m, 3), platform axes.
    """
    keep = np.isfinite(rpy_rad).all(axis=1) & np.concatenate([[True], np.diff(time_ns) > 0])
    time_ns, rpy_rad = time_ns[keep], rpy_rad[keep]
    every = max(1, round(0.1e9 / max(float(np.median(np.diff(time_ns))), 1.0))) if len(time_ns) > 20 else 1
    time_ns, rpy_rad = time_ns[::every], rpy_rad[::every]
    if len(time_ns) < 10 or len(imu_time_ns) < 10:
        return None
    steps_s = np.diff(imu_time_ns) * 1e-9
    turned = np.vstack(
        [np.zeros(3), np.cumsum(0.5 * (omega_p_radps[1:] + omega_p_radps[:-1]) * steps_s[:, None], axis=0)]
    )
    seconds = (imu_time_ns - imu_time_ns[0]) * 1e-9
    at = (time_ns - imu_time_ns[0]) * 1e-9
    lags = np.arange(-LAGS_S, LAGS_S + 0.5 * LAG_STEP_S, LAG_STEP_S)
    gyros = [(float(lag), *_gyro_rate(at + lag, turned, seconds)) for lag in lags]
    by_frame = {}
    for frame in ("ned_frd", "enu_flu"):
        attitude = platform_attitude(from_angles(*rpy_rad.T), frame, np.zeros(3), 0.0)
        rate = _increments(attitude) / (np.diff(time_ns) * 1e-9)[:, None]
        by_frame[frame] = max((_compare(rate, *gyro) for gyro in gyros), key=lambda one: one.correlation)
    frame = max(by_frame, key=lambda one: by_frame[one].correlation)
    other = by_frame["enu_flu" if frame == "ned_frd" else "ned_frd"]
    return replace(by_frame[frame], frame=frame, other=other.correlation)


def _increments(attitude: Rotation) -> Floats:
    return np.asarray((attitude[:-1].inv() * attitude[1:]).as_rotvec())


def _gyro_rate(when: Floats, turned: Floats, seconds: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """The intervals between times that the gyros cover, and the mean rate of the gyros in these."""
    inside = (when[:-1] >= seconds[0]) & (when[1:] <= seconds[-1])
    gyro = np.stack([np.diff(np.interp(when, seconds, turned[:, k])) for k in range(3)], axis=1)
    return inside, (gyro / np.diff(when)[:, None])[inside]


def _compare(rate: Floats, lag_s: float, inside: NDArray[np.bool_], gyro: Floats) -> AttitudeMatch:
    """The attitude's rate against the gyros' at a clock offset, at the quarter turn that fits roll and pitch best."""
    none = AttitudeMatch("", -1.0, -1.0, np.nan, lag_s, -1.0)
    if len(gyro) < 8:
        return none
    a, b = rate[inside], gyro
    # A quick jump is a wrap or a reset of the filter, not a turn.
    calm = np.linalg.norm(a, axis=1) < 8.0 * max(float(np.percentile(np.linalg.norm(a, axis=1), 90)), 1e-9)
    a, b = (x[calm] - x[calm].mean(axis=0) for x in (a, b))
    along = float((a[:, :2] * b[:, :2]).sum())
    across = float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    level = np.hypot(along, across) / max(
        float(np.sqrt((a[:, :2] ** 2).sum() * (b[:, :2] ** 2).sum())), 1e-12
    )
    angle = np.rad2deg(np.arctan2(across, along))
    quarters = round(angle / 90.0)
    if level < LEVEL or abs(angle - 90.0 * quarters) > OFF_QUARTER_DEG:
        quarters = 0
    if quarters:
        a = np.asarray(Rotation.from_euler("Z", 90.0 * quarters, degrees=True).apply(a))
    scale = float((b * b).sum())
    total = np.sqrt(float((a * a).sum()) * scale)
    if not total > 0.0:
        return none
    each = (a * b).sum(axis=0) / np.maximum(np.sqrt((a * a).sum(axis=0) * (b * b).sum(axis=0)), 1e-12)
    return AttitudeMatch(
        "", float((a * b).sum()) / total, -1.0, float((a * b).sum()) / scale, lag_s, float(each.min()),
        quarters % 4 if quarters % 4 != 3 else -1, float(level),
    )  # fmt: skip
