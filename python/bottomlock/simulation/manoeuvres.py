"""Short manoeuvres for observability studies: analytic motions with exact derivatives.

Every quantity that changes is a sine or a cosine of a rational angle from zero heading, so that the same motions can be
written as power series with rational coefficients and judged in exact arithmetic.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.simulation.analytic import Attitudes, Motion, sample_motion
from bottomlock.truth import Array, Truth, sample_times_ns

Angle = Callable[[Array], tuple[Array, Array]]
"""An angle and its rate at given times, rad and rad/s."""


@dataclass(frozen=True)
class Manoeuvre:
    """A motion with its words and a length for which it is meant.

    Attributes:
        name: short name.
        words: what the vehicle does.
        motion: Euler angles and body velocity as functions of time.
        duration_s: length of the window.
        joints_s: times at which a rate jumps; each becomes two samples a nanosecond apart.
    """

    name: str
    words: str
    motion: Motion
    duration_s: float
    joints_s: tuple[float, ...] = ()


def _zero(time_s: Array) -> tuple[Array, Array]:
    return np.zeros_like(time_s), np.zeros_like(time_s)


def steady(rate_radps: float, start_s: float = 0.0) -> Angle:
    """An angle that grows at a constant rate from `start_s` on."""

    def angle(time_s: Array) -> tuple[Array, Array]:
        # At a joint the first of its two samples, a nanosecond apart, still has the old rate.
        begun = time_s >= start_s + (0.5e-9 if start_s > 0.0 else 0.0)
        return np.where(begun, rate_radps * (time_s - start_s), 0.0), np.where(begun, rate_radps, 0.0)

    return angle


def swing(size_rad: float, rate_radps: float) -> Angle:
    """An angle that swings: size · sin(rate · t)."""

    def angle(time_s: Array) -> tuple[Array, Array]:
        phase = rate_radps * time_s
        return size_rad * np.sin(phase), size_rad * rate_radps * np.cos(phase)

    return angle


def dip(size_rad: float, rate_radps: float) -> Angle:
    """An angle that leaves zero and comes back: size · (1 - cos(rate · t))."""

    def angle(time_s: Array) -> tuple[Array, Array]:
        phase = rate_radps * time_s
        return size_rad * (1.0 - np.cos(phase)), size_rad * rate_radps * np.sin(phase)

    return angle


def motion_of(speed_mps: float, *, yaw: Angle = _zero, pitch: Angle = _zero) -> Motion:
    """Constant surge, wings level, with given yaw and pitch."""

    def motion(time_s: Array) -> Attitudes:
        zero = np.zeros_like(time_s)
        (psi, psi_rate), (theta, theta_rate) = yaw(time_s), pitch(time_s)
        surge = np.zeros((*time_s.shape, 3))
        surge[..., 0] = speed_mps
        return Attitudes(
            roll_rad=zero, pitch_rad=theta, yaw_rad=psi, roll_rate=zero, pitch_rate=theta_rate, yaw_rate=psi_rate,
            velocity_p_mps=surge, acceleration_p_mps2=np.zeros_like(surge),
        )  # fmt: skip

    return motion


_SPEED, _TURN, _BEAT = 2.0, 1.0 / 16.0, 1.0 / 8.0
"""m/s, rad/s and rad/s: dyadic, so that the exact study uses the same numbers."""

MANOEUVRES: dict[str, Manoeuvre] = {
    each.name: each
    for each in (
        Manoeuvre("hover", "rest, level", motion_of(0.0), 64.0),
        Manoeuvre("straight", "2 m/s, level, one heading", motion_of(_SPEED), 64.0),
        Manoeuvre("yaw_turn", "2 m/s, 3.6 deg/s to starboard", motion_of(_SPEED, yaw=steady(_TURN)), 64.0),
        Manoeuvre(
            "pitch_oscillation", "2 m/s, pitch 14 deg up and down in 50 s",
            motion_of(_SPEED, pitch=swing(0.25, _BEAT)), 64.0,
        ),
        Manoeuvre(
            "figure_eight", "2 m/s, yaw 143 deg to either side in 50 s",
            motion_of(_SPEED, yaw=swing(2.5, _BEAT)), 64.0,
        ),
        Manoeuvre(
            "dive_and_turn", "2 m/s, bow down to 29 deg and up again in a turn of 3.6 deg/s",
            motion_of(_SPEED, yaw=steady(_TURN), pitch=dip(-0.25, _BEAT)), 64.0,
        ),
    )
}  # fmt: skip
"""Manoeuvres by name."""


def manoeuvre_truth(
    manoeuvre: Manoeuvre,
    *,
    rate_hz: float = 150.0,
    latitude_rad: float = math.atan2(3.0, 4.0),
    gravity_mps2: float = 9.8125,
    earth_rate_radps: float = 0.0,
) -> Truth:
    """The truth of a manoeuvre.

    Raises:
        DataError: for a rate at which the window holds fewer than two samples, or a joint outside it.

    Examples:
        >>> truth = manoeuvre_truth(MANOEUVRES["yaw_turn"], rate_hz=10.0)
        >>> len(truth.time_ns), truth.omega_p_radps[0].tolist()
        (641, [0.0, 0.0, 0.0625])
    """
    times: NDArray[np.int64] = sample_times_ns(manoeuvre.duration_s, rate_hz)
    if len(times) < 2:
        raise DataError(
            f"{rate_hz:g} Hz is less than two samples in its window", place=f"manoeuvre {manoeuvre.name}"
        )
    for joint_s in manoeuvre.joints_s:
        if not 0.0 < joint_s < manoeuvre.duration_s:
            raise DataError(
                f"joint at {joint_s:g} s lies outside its window", place=f"manoeuvre {manoeuvre.name}"
            )
        joint_ns = round(joint_s * 1e9)
        times = np.union1d(times, [joint_ns, joint_ns + 1])
    return sample_motion(
        manoeuvre.motion,
        times,
        latitude_rad=latitude_rad,
        gravity_mps2=gravity_mps2,
        earth_rate_radps=earth_rate_radps,
    )
