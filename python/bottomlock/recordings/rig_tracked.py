"""A recorded attitude and velocity that the velocity of a DVL is held against."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bottomlock.recordings.rig_at import AtPings
from bottomlock.recordings.robust import BLOCKS
from bottomlock.recordings.rotation import rotation_matrices, rotation_vectors
from bottomlock.recordings.streams import Floats, Integers

RATE_S = 0.1
"""Angular rates are means over this on either side."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """Attitude and velocity at even times, so close that straight lines join them.

    Attributes:
        time_ns: (m,) rising.
        rotation: (m, 3, 3) from the platform to axes that do not turn.
        velocity_mps: (m, 3) in these.
        change_s: the velocity's change is taken over this on either side: a shorter one takes its noise for motion.
    """

    time_ns: Integers
    rotation: Floats
    velocity_mps: Floats
    change_s: float

    @cached_property
    def rates(self) -> tuple[Floats, Floats, Floats]:
        """(m, 3) change of the velocity, angular rate and its change, platform axes."""
        C, v = self.rotation, self.velocity_mps
        step_s = float(np.median(np.diff(self.time_ns))) * 1e-9
        few, many = (max(1, round(span / step_s)) for span in (RATE_S, self.change_s))
        omega = rotation_vectors(np.swapaxes(_moved(C, -few), 1, 2) @ _moved(C, few)) / (2.0 * few * step_s)
        turning, change = ((_moved(x, many) - _moved(x, -many)) / (2.0 * many * step_s) for x in (omega, v))
        return np.einsum("mji,mj->mi", C, change), omega, turning

    def at(self, time_ns: Integers) -> AtPings:
        """The motion at the pings that lie within it."""
        C, kept = self.rotation, (time_ns >= self.time_ns[0]) & (time_ns < self.time_ns[-1])
        at_ns = time_ns[kept]
        row = np.searchsorted(self.time_ns, at_ns, side="right") - 1
        part = ((at_ns - self.time_ns[row]) / np.diff(self.time_ns)[row])[:, None]

        def between(values: Floats) -> Floats:
            return np.asarray(values[row] + part * (values[row + 1] - values[row]))

        turn = rotation_vectors(np.swapaxes(C[row], 1, 2) @ C[row + 1])
        segment = np.arange(len(at_ns)) * BLOCKS // max(len(at_ns), 1)
        first = np.searchsorted(segment, np.arange(BLOCKS))
        begins = at_ns[np.minimum(first, len(at_ns) - 1)] if len(at_ns) else np.zeros(BLOCKS, dtype=np.int64)
        zero = np.zeros((len(at_ns), 3, 3))
        force, omega, turning = map(between, self.rates)
        return AtPings(
            kept, segment, begins, (at_ns - begins[segment]) * 1e-9, C[row] @ rotation_matrices(part * turn),
            between(self.velocity_mps), zero, zero, force, omega, turning, lined=False,
        )  # fmt: skip


def _moved(values: Floats, rows: int) -> Floats:
    """Values (m, ...) so many rows later; the last or first one beyond the ends."""
    return np.asarray(values[np.clip(np.arange(len(values)) + rows, 0, len(values) - 1)])
