"""Units and axes by magnitude, gravity and rate, each with the reason that a case file states."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bottomlock.recordings.rig_motion import integrate
from bottomlock.recordings.robust import white_sd
from bottomlock.recordings.streams import Floats, Inertial, Integers
from bottomlock.replay.init.entries import Entry
from bottomlock.replay.read_tables import OMEGA_SI, PRESSURE_SI
from bottomlock.units import STANDARD_GRAVITY_MPS2

ROOM = 1.35
"""A size may be this many times larger or smaller than gravity: vehicles accelerate, sensors have scale errors."""
DEG = np.pi / 180.0
FAST_RADPS = 6.0
"""A vehicle does not turn faster for a hundredth of the time: larger numbers are degrees per second."""


@dataclass(frozen=True)
class Guess:
    """A value, why, whether it is certain enough to be called guessed (else it is a question), and a factor to it.

    Of a stream's clock it is the offset to the IMU's, s.
    """

    value: Any
    why: str = ""
    known: bool = True
    factor: float = 1.0

    def entry(self, key: str, asks: str = "") -> Entry:
        """As the entry of a key, and the question that decides what is not known."""
        return Entry(key, self.value, self.why, known=self.known, asks=asks)


NOTHING = Guess(0.0)
"""Of a clock that is the IMU's, and of a yaw that is true."""


def force_unit(force: Floats) -> Guess | None:
    """Unit of specific force by its median size, which is gravity; None where it is not in it.

    >>> force_unit(np.tile([0.1, 0.0, -1.0], (5, 1))).value
    'g'
    """
    size = float(np.nanmedian(np.linalg.norm(force, axis=1)))
    for unit, gravity in (("m/s2", STANDARD_GRAVITY_MPS2), ("g", 1.0), ("mg", 1000.0)):
        if gravity / ROOM < size < gravity * ROOM:
            return Guess(unit, f"|f| has a median of {size:.4g}")
    if size > 1000.0 * ROOM:
        why = f"|f| has a median of {size:.4g} counts, taken to be gravity"
        return Guess("m/s2", why, factor=STANDARD_GRAVITY_MPS2 / size)
    return None


def omega_unit(time_ns: Integers, force_mps2: Floats, omega: Floats, hint: str) -> Guess:
    """Unit of angular rate: by its name, by its size, or by which one keeps gravity's direction steady.

    Args:
        time_ns, force_mps2, omega: (n,), (n, 3) in m/s², (n, 3) as recorded.
        hint: unit as the column's name states it.
    """
    p99 = float(np.nanpercentile(np.linalg.norm(omega, axis=1), 99))
    if hint in OMEGA_SI and not (hint == "rad/s" and p99 > FAST_RADPS):
        return Guess(hint, f"the column's name says so; 99 % of |ω| are below {p99:.3g}")
    if p99 > 3600.0:
        return Guess("deg/h", f"99 % of |ω| are below {p99:.4g}: only degrees per hour are plausible")
    if p99 > FAST_RADPS:
        return Guess(
            "deg/s", f"99 % of |ω| are below {p99:.3g}: no vehicle turns that many radians per second"
        )
    # Of left-handed axes the rate has the other sign.
    rough = {
        unit: min(gravity_unsteady(time_ns, force_mps2, sign * factor * omega) for sign in (1.0, -1.0))
        for unit, factor in _RATES.items()
    }
    best, other = sorted(rough, key=lambda one: rough[one])
    if rough[other] > 1.2 * rough[best]:
        why = f"gravity stays in place to {rough[best]:.3g} m/s in 20 s with it, to {rough[other]:.3g} with {other}"
        return Guess(best, why)
    why = f"99 % of |ω| are below {p99:.3g}, and gravity does not decide: the vehicle hardly tilts"
    return Guess("rad/s" if p99 < 0.8 else "deg/s", why, known=False)


_RATES = {"rad/s": 1.0, "deg/s": DEG}


def gravity_unsteady(time_ns: Integers, force: Floats, omega: Floats) -> float:
    """RMS departure of the integrated specific force from a line in segments, m/s, with any gyro bias."""
    segments = integrate(Inertial(time_ns, force, omega))
    if segments is None:
        return float("nan")
    at = segments.at(segments.time_ns.ravel())
    left = at.left(np.concatenate([at.S[:, :, None], at.K], axis=2))[0].reshape(-1, 4)
    A, y = left[:, 1:], left[:, 0]
    answer = np.linalg.lstsq(A, y, rcond=None)[0]
    return float(np.sqrt(np.mean((y - A @ answer) ** 2)))


def down_axis(force: Floats) -> tuple[int, float, float]:
    """The sensor axis that points most nearly down, its sign, and its angle from the vertical, rad.

    At rest specific force points up: a sensor with z down reads −g on it.

    >>> down_axis(np.array([[0.0, 0.0, 9.8]]))
    (2, -1.0, 0.0)
    """
    mean = np.nanmean(force, axis=0)
    axis = int(np.argmax(np.abs(mean)))
    size = max(float(np.linalg.norm(mean)), 1e-12)
    angle = float(np.arccos(np.clip(abs(mean[axis]) / size, -1.0, 1.0)))
    return axis, -float(np.sign(mean[axis])), angle


def axes_with_down(axis: int, sign: float) -> Floats:
    """(3, 3) from sensor to platform axes, right-handed, with a sensor axis down; x stays forward where it can.

    >>> axes_with_down(2, -1.0).tolist()
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
    """
    down = np.zeros(3)
    down[axis] = sign
    forward = np.zeros(3)
    forward[0 if axis != 0 else 1] = 1.0
    return np.stack([forward, np.cross(down, forward), down]) + 0.0


def axis_names(matrix: Floats) -> tuple[str, str, str]:
    """The case's `axes` of a signed permutation.

    >>> axis_names(np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]))
    ('y', '-x', 'z')
    """
    chosen = []
    for row in matrix:
        k = int(np.argmax(np.abs(row)))
        chosen.append(("-" if row[k] < 0.0 else "") + "xyz"[k])
    return chosen[0], chosen[1], chosen[2]


def pressure_unit(pressure: Floats, hint: str) -> Guess:
    """Unit of a pressure by its name or size; the surface is at 1.013 bar, or at 0 where it has been subtracted."""
    median = float(np.nanmedian(pressure))
    if hint in PRESSURE_SI:
        return Guess(hint, f"the column's name says so; its median is {median:.4g}")
    for unit, least in (("Pa", 2e4), ("mbar", 700.0), ("kPa", 70.0), ("dbar", 8.5), ("bar", 0.0)):
        if median > least:
            return Guess(unit, f"its median is {median:.4g}", known=unit in {"Pa", "mbar", "kPa"})
    return Guess("bar", f"its median is {median:.4g}", known=False)


def angle_unit(angle: Floats, hint: str) -> Guess:
    """Unit of angles by their name or their range.

    >>> angle_unit(np.array([10.0, 350.0]), "").value, angle_unit(np.array([0.1, 3.1]), "").value
    ('deg', 'rad')
    """
    largest = float(np.nanmax(np.abs(angle)))
    if hint == "deg" or (hint == "rad" and largest < 7.0):
        return Guess(hint, "the column's name says so")
    if largest > 2.0 * np.pi + 0.2:
        return Guess("deg", f"the largest is {largest:.4g}")
    return Guess("rad", f"the largest is {largest:.3g}", known=largest > 1.2)


def white_noise(time_ns: Integers, values: Floats) -> float:
    """Noise of readings, unit/√Hz·√s, from their second differences; the motion's vibration is in it."""
    step_s = float(np.median(np.diff(time_ns))) * 1e-9
    return float(np.max(white_sd(values, 2)) * np.sqrt(step_s))


def round_up(value: float) -> float:
    """A number with one leading digit of 1, 2 or 5, not below.

    >>> [round_up(value) for value in (0.13, 0.3, 7.0)]
    [0.2, 0.5, 10.0]
    """
    if not value > 0.0:
        return 0.0
    power = 10.0 ** np.floor(np.log10(value) + 1e-9)
    return float(
        next(float(f"{lead * power:.3g}") for lead in (1.0, 2.0, 5.0, 10.0) if lead * power >= value * 0.999)
    )
