"""Where a fit of the rig begins: clocks and axes of a velocity brought to those of a motion by a search."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.rig_fit import LOOSE, Match, Recorded, fit
from bottomlock.recordings.rig_motion import LEAST_PINGS, Segments, Tracked
from bottomlock.recordings.rotation import rotation_matrices
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


def _normal(motion: Segments | Tracked, recorded: Recorded, offset_ns: int) -> tuple[Floats, int] | None:
    """(16, 16) products of what the motion says, of any matrix between the axes, and of biases; and their rows.

    None with too few pings.
    """
    at = motion.at(recorded.time_ns + offset_ns)
    if at.kept.sum() < 6 * LEAST_PINGS:
        return None
    v = recorded.velocity_p_mps[at.kept]
    columns = (at.C[:, :, :, None] * v[:, None, None, :]).reshape(len(v), 3, 9)
    left, _ = at.left(np.concatenate([at.S[:, :, None], columns, at.J, at.K], axis=2))
    flat = left.reshape(-1, left.shape[2])
    return flat.T @ flat, len(flat)


def _residual(motion: Segments | Tracked, recorded: Recorded, offset_ns: int) -> float:
    """RMS residual, m/s, with any matrix between the axes, gyro and accelerometer biases; NaN with too few pings."""
    found = _normal(motion, recorded, offset_ns)
    if found is None:
        return float("nan")
    (whole, rows) = found
    normal, right = whole[1:, 1:] + np.diag(1e-9 * np.diag(whole)[1:] + 1e-12), whole[1:, 0]
    left_over = float(whole[0, 0] - np.linalg.solve(normal, right) @ right)
    return float(np.sqrt(max(left_over, 0.0) / max(1.0, rows - 16.0)))


def search_offset(recorded: Recorded, from_s: float, to_s: float) -> Searched | None:
    """The clock offset, within a range, at which a velocity follows the inertial readings best.

    Args:
        recorded: readings and velocities, in any axes of their own.
        from_s, to_s: range of the offset to add to the velocity's times.
    """
    motion = recorded.integrated()
    if motion is None or not to_s > from_s:
        return None
    step_s = max(GRID_S, (to_s - from_s) / MOST_LAGS)
    lags = np.arange(from_s, to_s + 0.5 * step_s, step_s)
    cost = np.array([_residual(motion, recorded, round(float(lag) * 1e9)) for lag in lags])
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


MIRROR = np.diag([1.0, -1.0, 1.0])
YAWS_DEG = range(0, 360, 15)
CLEARLY = 0.8
"""Ratio of the residuals below which a frame upside down or mirrored is taken."""


def fit_anyhow(
    recorded: Recorded,
    offsets_s: Floats | None = None,
    prior: Mapping[str, float] = LOOSE,
    *,
    around: bool = False,
) -> Match | None:
    """The fit from the axes, and the clock offset of some, that a search finds; None with too few pings.

    Where the search is far off, as of a DVL that looks forward, the passes of one fit do not suffice: a second one is
    about axes that are those of the platform by then.

    Args:
        recorded: motion and velocities, in any axes of their own.
        offsets_s: clock offsets to try; 0 by default.
        prior, around: of `rig_fit.fit`.
    """
    begun = search_axes(recorded, np.zeros(1) if offsets_s is None else offsets_s)
    first = None if begun is None else fit(recorded, prior=prior, axes=begun[0], clock_s=begun[1])
    if first is None:
        return None
    clock_s = float(first.part("clock")[0])
    return fit(recorded, prior=prior, axes=first.turned, clock_s=clock_s, around=around)


def search_axes(recorded: Recorded, offsets_s: Floats) -> tuple[Floats, float] | None:
    """Axes (3, 3) of a velocity, of either hand, upright or upside down, and its clock offset, by least residual.

    A frame upside down or mirrored must fit clearly better: a velocity ahead or in a plane fits it as well.

    Args:
        recorded: motion and velocities.
        offsets_s: offsets to try.
    """
    motion = recorded.integrated()
    upright = [rotation_matrices(np.array([0.0, 0.0, yaw])) for yaw in np.deg2rad(YAWS_DEG)]
    flip = np.diag([1.0, -1.0, -1.0])
    kinds = [upright, [C @ flip for C in upright], [C @ M for C in upright for M in (MIRROR, flip @ MIRROR)]]
    none = (np.inf, np.inf, 0.0, np.eye(3))
    best = [none for _ in kinds]
    if motion is None:
        return None
    for offset in offsets_s:
        found = _normal(motion, recorded, round(float(offset) * 1e9))
        if found is None:
            continue
        whole, rows = found
        whole = whole + np.diag(1e-9 * np.diag(whole) + 1e-12)
        # What the biases take is taken from all.
        free = whole[:10, :10] - whole[:10, 10:] @ np.linalg.solve(whole[10:, 10:], whole[10:, :10])
        for k, frames in enumerate(kinds):
            tried = np.concatenate([np.ones((len(frames), 1)), -np.array(frames).reshape(-1, 9)], axis=1)
            cost = np.sqrt(np.maximum(np.einsum("fi,ij,fj->f", tried, free, tried), 0.0) / rows)
            one = int(np.argmin(cost))
            if (cost[one], abs(offset)) < best[k][:2]:
                best[k] = (float(cost[one]), abs(float(offset)), float(offset), frames[one])
    chosen = best[0]
    for other in best[1:]:
        if other[0] < CLEARLY * chosen[0]:
            chosen = other
    return (chosen[3], chosen[2]) if np.isfinite(chosen[0]) else None
