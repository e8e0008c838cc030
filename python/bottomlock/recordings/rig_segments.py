"""Inertial readings integrated over short segments, each from its own beginning: no attitude is needed.

In the axes b₀ of the platform at the beginning of a segment, with C the rotation from the platform to b₀,

    C(t) v(t) − ∫ C f dt = v₀ + g t

is a straight line in time, whatever the attitude: its slope is gravity in b₀. What departs from a line is an error of
the velocity, of the sensors, or of what was stated about them. The Earth's rate is left out, or subtracted before.
"""

from dataclasses import dataclass

import numpy as np

from bottomlock.kernel import integrate_segments
from bottomlock.recordings.rig_at import AtPings, applied
from bottomlock.recordings.rotation import rotation_matrices
from bottomlock.recordings.streams import Floats, Inertial, Integers

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
