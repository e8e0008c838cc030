"""Clocks of a velocity and of inertial readings brought together by a search, whatever the axes of either."""

from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.rig_fit import Recorded
from bottomlock.recordings.rig_segments import LEAST_PINGS, Segments, at_pings, integrate, lines
from bottomlock.recordings.streams import Floats

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
    segments = integrate(recorded.inertial)
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
