"""What a recorded motion says at the pings of a DVL, in axes that do not turn."""

from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.streams import Flags, Floats, Integers


@dataclass(frozen=True, eq=False)
class AtPings:
    """Integrals of inertial readings at the pings that lie in their segments, or a recorded motion there.

    Attributes:
        kept: (n,) which pings these are.
        segment: (p,) number of the segment.
        begins_ns: (s,) times at which the segments begin.
        time_s: (p,) since then.
        C: (p, 3, 3) rotation from the platform to the axes of the segment.
        S: (p, 3) velocity in these: that of the specific force, but for a line in time, or the whole of a recorded one.
        J, K: (p, 3, 3) effects of biases, see `rig_segments.Segments`; zero of a recorded motion.
        force, omega, turning: (p, 3) rate of change of S, angular rate and its rate of change, platform axes.
        lined: whether S is known but for a line in time.
    """

    kept: Flags
    segment: Integers
    begins_ns: Integers
    time_s: Floats
    C: Floats
    S: Floats
    J: Floats
    K: Floats
    force: Floats
    omega: Floats
    turning: Floats
    lined: bool

    def left(self, values: Floats) -> tuple[Floats, Floats]:
        """Residuals of columns (p, 3, c) from a line in every segment, and the slopes (s, 3, c)."""
        flat, count = values.reshape(len(values), -1), len(self.begins_ns)
        if not self.lined:
            return values, np.zeros((count, *values.shape[1:]))

        def sums(column: Floats) -> Floats:
            return np.stack(
                [np.bincount(self.segment, column[:, k], minlength=count) for k in range(column.shape[1])],
                axis=1,
            )

        n = np.maximum(np.bincount(self.segment, minlength=count), 1)[:, None]
        mean_t = sums(self.time_s[:, None]) / n
        t = self.time_s[:, None] - mean_t[self.segment]
        mean = sums(flat) / n
        centred = flat - mean[self.segment]
        slope = sums(t * centred) / np.maximum(sums(t * t), 1e-12)
        left = centred - t * slope[self.segment]
        return left.reshape(values.shape), slope.reshape(count, *values.shape[1:])


def applied(matrix: Floats, v: Floats) -> Floats:
    """Matrices (p, 3, 3) times vectors (p, 3)."""
    return np.asarray(np.einsum("pij,pj->pi", matrix, v))
