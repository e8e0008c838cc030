"""A motion that the velocity of a DVL is held against: integrals of inertial readings, or a recorded velocity.

Inertial readings are integrated over short segments, each from its own beginning: no attitude is needed. In the axes b₀
of the platform at the beginning of a segment, with C the rotation from the platform to b₀,

    C(t) v(t) − ∫ C f dt = v₀ + g t

is a straight line in time, whatever the attitude: its slope is gravity in b₀. What departs from a line is an error of
the velocity, of the sensors, or of what was stated about them. The Earth's rate is left out, or subtracted before.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bottomlock.kernel import integrate_segments
from bottomlock.recordings.robust import BLOCKS
from bottomlock.recordings.rotation import rotation_matrices, rotation_vectors
from bottomlock.recordings.streams import Flags, Floats, Inertial, Integers


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


LENGTH_S = 20.0
"""Length of a segment: a gyro bias of 100°/h makes a velocity error of 0.95 m/s in it, one of accelerometers none."""
MOST_HZ = 100.0
"""Faster readings are averaged to about this rate."""
MOST_SEGMENTS = 90
"""Segments used of a longer recording, evenly spread over it."""
LONGEST_STEP_S = 0.5
"""Segments with a longer step between readings are left out."""
LARGEST = 1e6
"""Segments with a reading of this size, m/s² or rad/s, are left out: no instrument has such a full scale."""
LEAST_PINGS = 5
"""Pings of a segment that is used: a line takes two."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Strapdown integrals at the reading times of every segment, (s, m, ...).

    Attributes:
        time_ns: (s, m), rising within a segment and from one to the next.
        force_p_mps2, omega_p_radps: (s, m, 3) the readings.
        rotation: (s, m, 3, 3) C, from the platform to its axes at the segment's beginning.
        force_integral_mps: (s, m, 3) ∫ C f dt.
        rotation_integral_s: (s, m, 3, 3) ∫ C dt.
        bias_integral: (s, m, 3, 3) column j: ∫ (∫C dt eⱼ) × C f dt, the effect of a gyro bias along axis j.
    """

    time_ns: Integers
    force_p_mps2: Floats
    omega_p_radps: Floats
    rotation: Floats
    force_integral_mps: Floats
    rotation_integral_s: Floats
    bias_integral: Floats

    @property
    def count(self) -> int:
        """Number of segments."""
        return len(self.time_ns)

    @property
    def length_s(self) -> float:
        """Length of each."""
        return float(self.time_ns[0, -1] - self.time_ns[0, 0]) * 1e-9

    def at(self, time_ns: Integers) -> AtPings:
        """The integrals at the pings that lie in a segment with enough of them; `time_ns` on the IMU's clock."""
        s, m = self.time_ns.shape
        flat = self.time_ns.ravel()
        index = np.clip(np.searchsorted(flat, time_ns, side="right") - 1, 0, s * m - 1)
        segment = index // m
        after_s = (time_ns - flat[index]) * 1e-9
        step_s = float(np.median(np.diff(self.time_ns[0]))) * 1e-9
        kept = (after_s >= 0.0) & (after_s <= 2.0 * step_s)
        counts = np.bincount(segment[kept], minlength=s)
        kept &= counts[segment] >= LEAST_PINGS
        index, segment, after_s = index[kept], segment[kept], after_s[kept]

        def rows(values: Floats) -> Floats:
            return np.asarray(values.reshape(s * m, *values.shape[2:])[index])

        C, force, omega = rows(self.rotation), rows(self.force_p_mps2), rows(self.omega_p_radps)
        S = rows(self.force_integral_mps) + applied(C, force) * after_s[:, None]
        begins = self.time_ns[:, 0]
        C = C @ rotation_matrices(omega * after_s[:, None])
        return AtPings(
            kept, segment, begins, (time_ns[kept] - begins[segment]) * 1e-9, C, S, rows(self.rotation_integral_s),
            rows(self.bias_integral), force, omega, np.zeros_like(omega), lined=True,
        )  # fmt: skip


def block_means(time_ns: Integers, values: Floats, k: int) -> tuple[Integers, Floats]:
    """Means over blocks of k rows: times (n // k,) and values (n // k, 3)."""
    rows = len(time_ns) // k * k
    start = int(time_ns[0])
    mean_ns = (time_ns[:rows] - start).reshape(-1, k).mean(axis=1)
    return np.round(mean_ns).astype(np.int64) + start, values[:rows].reshape(-1, k, 3).mean(axis=1)


def integrate(
    inertial: Inertial, *, gyro_bias_radps: Floats | float = 0.0, length_s: float = LENGTH_S
) -> Segments | None:
    """Cuts inertial readings into segments and integrates each; None for a recording without a whole segment.

    Args:
        inertial: readings, their times rising.
        gyro_bias_radps: (3,) subtracted from the rates.
        length_s: of a segment.
    """
    time_ns, force_p_mps2 = inertial.time_ns, inertial.force_p_mps2
    omega_p_radps = inertial.omega_p_radps - gyro_bias_radps
    if len(time_ns) < 10:
        return None
    step_s = float(np.median(np.diff(time_ns))) * 1e-9
    k = max(1, int(1.0 / (step_s * MOST_HZ) + 1e-6))
    if k > 1:
        _, omega_p_radps = block_means(time_ns, omega_p_radps, k)
        time_ns, force_p_mps2 = block_means(time_ns, force_p_mps2, k)
    m = max(4, round(length_s / (step_s * k)))
    s = len(time_ns) // m
    if s == 0:
        return None
    time = time_ns[: s * m].reshape(s, m)
    steps_s = np.diff(time, axis=1) * 1e-9
    force, omega = (values[: s * m].reshape(s, m, 3) for values in (force_p_mps2, omega_p_radps))
    steady = (steps_s.max(axis=1) < LONGEST_STEP_S) & (steps_s.min(axis=1) > 0.0)
    # False of what is no number, too.
    sane = (np.abs(force).max(axis=(1, 2)) < LARGEST) & (np.abs(omega).max(axis=(1, 2)) < LARGEST)
    whole = np.flatnonzero(steady & sane)
    if not whole.size:
        return None
    if len(whole) > MOST_SEGMENTS:
        whole = whole[np.round(np.linspace(0, len(whole) - 1, MOST_SEGMENTS)).astype(int)]
    force, omega = force[whole], omega[whole]
    time = time[whole]
    integrals = integrate_segments(time.ravel(), force.reshape(-1, 3), omega.reshape(-1, 3), m)
    return Segments(time, force, omega, **integrals)


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
