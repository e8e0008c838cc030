"""Readings that are none: streams that stand still, and steps that no vehicle makes.

A stream stands still where it repeats its value to the last digit far longer than it does elsewhere. A step is a change
between two readings that neither a vehicle nor the gyros make; the longer part of the recording, before or after it, is
taken for the right one. Such rows are left out, and counted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.streams import Attitudes, Depths, Flags, Floats, Inertial, Times, integrals

STILL_S, STILL_ROWS = 10.0, 20
STILL_RUNS = 50.0
"""Rows of a standing run over those of nearly every other run: an instrument may write each reading several times."""
USUAL = 0.99
SINK_MPS, SINK_M = 3.0, 0.5
"""Vertical speed, and least step, that no vehicle reaches between two depths."""
TURN_RAD = float(np.deg2rad(5.0))
"""Least step of an attitude that the gyros do not show."""
SCATTERS = 10.0
"""Step over the usual scatter of the steps (median absolute deviation)."""
ALONE = 4.0
"""Step of an attitude over the two before and after it: axes that are not as stated leave one beside the other."""
LONGEST_S = 2.0
"""Interval over which the gyros' bias is no step."""


@dataclass(frozen=True)
class LeftOut:
    """Rows of a stream that are left out.

    Attributes:
        stream: its section in a case.
        why: in words, "stands still" or "steps by ...".
        rows, of: how many of how many.
        first_s: Unix time, or that of the case's clock, of the first.
        doubtful: the rows that stay may be the wrong ones.
        used: they are used nevertheless, since nothing can take their place.
    """

    stream: str
    why: str
    rows: int
    of: int
    first_s: float
    doubtful: bool = False
    used: bool = False

    @property
    def share(self) -> float:
        """Part of the stream."""
        return self.rows / max(self.of, 1)

    @property
    def words(self) -> str:
        """In one sentence."""
        return (
            f"[{self.stream}] {self.why}: {self.rows} of {self.of} rows ({100.0 * self.share:.2g} %) are "
            f"{'used as they are' if self.used else 'left out'}, from {self.first_s:.3f} s on."
        )


def standing(time_ns: Times, values: Floats) -> Flags:
    """Rows (n,) that repeat the reading before them, of runs in which a stream stands still.

    Args:
        time_ns: (n,) times.
        values: (n, k) readings.

    >>> values = np.concatenate([np.arange(200.0), np.full(300, 7.0)])[:, None]
    >>> int(standing(np.arange(500) * 100_000_000, values).sum())
    299
    """
    found = np.zeros(len(time_ns), dtype=np.bool_)
    if len(time_ns) < STILL_ROWS:
        return found
    begins = np.flatnonzero(np.concatenate([[True], (np.diff(values, axis=0) != 0.0).any(axis=1)]))
    ends = np.concatenate([begins[1:], [len(time_ns)]])
    rows, seconds = ends - begins, (time_ns[ends - 1] - time_ns[begins]) * 1e-9
    long = (rows >= STILL_ROWS) & (seconds >= STILL_S)
    # Until its first change a vehicle may be at rest; a stream that hardly ever changes has no usual run.
    long[0] = False
    if not long.any() or len(rows) < STILL_ROWS:
        return found
    usual = float(np.quantile(rows[~long], USUAL))
    for begin, end in zip(begins[long], ends[long], strict=True):
        found[begin + 1 : end] = end - begin > STILL_RUNS * usual
    return found


def repeated(time_ns: Times, velocity_mps: Floats, valid: Flags) -> Flags:
    """Pings (n,) of beams or velocities (n, k) of runs in which a DVL, or what logs it, stands still."""
    return standing(time_ns, np.where(valid, velocity_mps, 0.0)) & valid.any(axis=1)


def beside_the_steps(offsets: Floats, near: float) -> Flags:
    """Rows (n,) whose sum of steps (n,) is not within `near` of that of most rows."""
    if not offsets.any():
        return np.zeros(len(offsets), dtype=np.bool_)
    groups = np.round(offsets / (2.0 * near)).astype(np.int64)
    values, counts = np.unique(groups, return_counts=True)
    middle = float(np.median(offsets[groups == values[np.argmax(counts)]]))
    return np.asarray(np.abs(offsets - middle) > near)


def depth_steps(depths: Depths) -> Floats:
    """(n,) sum of the steps up to each depth, m."""
    step = np.diff(depths.depth_m)
    seconds = np.diff(depths.time_ns) * 1e-9
    usual = SCATTERS * 1.4826 * float(np.median(np.abs(step))) if len(step) else 0.0
    stepped = np.abs(step) > np.maximum(SINK_MPS * seconds, max(SINK_M, usual))
    return np.concatenate([[0.0], np.cumsum(np.where(stepped, step, 0.0))])


def yaw_steps(attitudes: Attitudes, inertial: Inertial) -> Floats:
    """(n,) sum of the steps of the yaw up to each attitude that the gyros do not show, rad.

    The gyros' turn between two attitudes is their mean rate over the interval, in platform axes.
    """
    time_ns = attitudes.time_ns
    if len(time_ns) < STILL_ROWS:
        return np.zeros(len(time_ns))
    at = (time_ns - time_ns[0]) * 1e-9
    turned = integrals(inertial.time_ns, inertial.omega_p_radps, time_ns)
    C = attitudes.attitude
    left = C[1:] * (C[:-1] * Rotation.from_rotvec(turned)).inv()
    step = left.as_rotvec()[:, 2]
    usual = SCATTERS * 1.4826 * float(np.median(np.abs(step - np.median(step))))
    size = np.pad(np.abs(step), 2)
    beside = np.max([size[:-4], size[1:-3], size[3:-1], size[4:]], axis=0)
    stepped = (np.abs(step) > np.maximum(ALONE * beside, max(TURN_RAD, usual))) & (np.diff(at) < LONGEST_S)
    return np.concatenate([[0.0], np.cumsum(np.where(stepped, step, 0.0))])
