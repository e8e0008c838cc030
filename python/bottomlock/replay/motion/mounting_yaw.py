"""Yaw of a DVL on its vehicle: its track against recorded positions.

It is least squares of two columns, the velocity in the level plane as stated and turned by a quarter, so no first guess
is needed. Noise of the velocity does not bias the angle: it is not correlated with the other side.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.streams import Floats, Integers

WINDOW_S = 60.0
"""Windows of the track: long against the noise of positions, short against a walk of the heading."""
LEAST_WINDOWS = 4
LEAST_TRACK_M = 10.0
"""Distance travelled from which a track tells a direction."""


@dataclass(frozen=True)
class MountingYaw:
    """A yaw of the DVL's axes, from the platform's forward to starboard.

    Attributes:
        yaw_rad, sd_rad: by scores of whole segments or windows.
        agreement: correlation of both sides at this yaw.
        scale: of the DVL's velocity over the other side's, at this yaw; 1 is expected of a track.
        parts: number of segments or windows.
    """

    yaw_rad: float
    sd_rad: float
    agreement: float
    scale: float
    parts: int

    @property
    def words(self) -> str:
        """Angle, sigma and agreement."""
        yaw, sd = np.rad2deg(self.yaw_rad), np.rad2deg(self.sd_rad)
        return f"{yaw:+.1f} ± {sd:.2g} deg (agreement {self.agreement:.2f})"


def yaw_by_positions(
    time_ns: Integers,
    velocity_p_mps: Floats,
    attitude: Rotation,
    position_time_ns: Integers,
    north_east_m: Floats,
) -> MountingYaw | None:
    """Yaw by which the track of the velocity follows recorded positions; None where these do not tell.

    A constant error of the heading, such as a declination left out, is part of it.

    Args:
        time_ns, velocity_p_mps: (p,), (p, 3) pings, in the DVL's axes.
        attitude: (p,) of the platform at the pings.
        position_time_ns, north_east_m: (k,), (k, 2), on the clock of the pings.
    """
    inside = (position_time_ns >= time_ns[0]) & (position_time_ns <= time_ns[-1])
    inside &= np.isfinite(north_east_m).all(axis=1)
    position_time_ns, place = position_time_ns[inside], north_east_m[inside]
    if len(place) < LEAST_WINDOWS + 1:
        return None
    marks = _marks(position_time_ns)
    if len(marks) < LEAST_WINDOWS + 1 or float(np.ptp(place[marks], axis=0).max()) < LEAST_TRACK_M:
        return None
    moved = np.diff(place[marks], axis=0)
    origin = int(time_ns[0])
    seconds, at_s = (time_ns - origin) * 1e-9, (position_time_ns[marks] - origin) * 1e-9
    steps_s = np.diff(seconds)[:, None]

    columns = []
    for side in _sides(velocity_p_mps):
        turned = attitude.apply(side)[:, :2]
        way = np.vstack([np.zeros(2), np.cumsum(0.5 * (turned[1:] + turned[:-1]) * steps_s, axis=0)])
        columns.append(np.diff(np.stack([np.interp(at_s, seconds, x) for x in way.T], axis=1), axis=0))
    a, b, vertical = columns
    return _yaw(a, b, moved - vertical, np.arange(len(moved)))


def _sides(velocity: Floats) -> tuple[Floats, Floats, Floats]:
    """Level velocity as stated, turned by a quarter to starboard, and the vertical one."""
    zero = np.zeros(len(velocity))
    x, y, z = velocity.T
    return np.stack([x, y, zero], 1), np.stack([-y, x, zero], 1), np.stack([zero, zero, z], 1)


def _yaw(a: Floats, b: Floats, felt: Floats, part: Integers) -> MountingYaw:
    """The yaw by which columns a, as stated, and b, turned by a quarter, follow; its sigma by scores of the parts."""
    along, across = np.einsum("pi,pi->p", a, felt), np.einsum("pi,pi->p", b, felt)
    c, s = float(along.sum()), float(across.sum())
    size = max(float(np.hypot(c, s)), 1e-30)
    scores = np.bincount(part, (c * across - s * along) / size)
    sd = min(float(np.sqrt((scores**2).sum())) / size, np.pi)
    stated, moved = float((a * a).sum()), float((felt * felt).sum())
    agreement = size / max(float(np.sqrt(stated * moved)), 1e-30)
    return MountingYaw(float(np.arctan2(s, c)), sd, agreement, stated / size, len(np.unique(part)))


def _marks(time_ns: Integers) -> list[int]:
    """Rows about a window apart."""
    marks = [0]
    for row in range(1, len(time_ns)):
        if time_ns[row] - time_ns[marks[-1]] >= WINDOW_S * 1e9:
            marks.append(row)
    return marks
