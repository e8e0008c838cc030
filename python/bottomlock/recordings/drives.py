"""The speed through the water, made of a propeller's revolutions or of the forces of thrusters."""

import math
from collections.abc import Callable

import numpy as np

from bottomlock.config.through_water import EffortErrors, ThrustErrors
from bottomlock.errors import KernelError
from bottomlock.recordings.readings import EffortReading, SpeedReading, ThrustReading
from bottomlock.recordings.streams import Floats

STEP_S = 0.02
"""Longest step of the speed by forces, s: a tenth of the time in which a small vehicle follows its thrusters."""
MOST_STEPS = 1000
"""Steps between two forces: after a longer time the speed has long been the steady one."""
FASTEST_MPS = 20.0
"""Speed through the water that no vehicle has: a larger one shows a wrong unit, advance, drag or force."""


def drag_beyond(section: EffortErrors) -> Floats:
    """(3,) the drag at `FASTEST_MPS`, N, which no thrusters overcome; infinite along an axis without drag.

    >>> drag_beyond(EffortErrors(mass_kg=(20, 20, 20), quadratic_drag_kg_per_m=(100, 0, 0))).tolist()
    [40000.0, inf, inf]
    """
    linear, quadratic = np.array(section.linear_drag_kg_per_s), np.array(section.quadratic_drag_kg_per_m)
    return np.where(section.driven, linear * FASTEST_MPS + quadratic * FASTEST_MPS**2, np.inf)


def speed_by_revolutions(section: ThrustErrors) -> Callable[[ThrustReading, Floats], SpeedReading]:
    """What makes of revolutions the speed along the vehicle's axis, by the advance; 0 at rest, which says nothing.

    >>> of = speed_by_revolutions(ThrustErrors(advance_m=0.1))
    >>> of(ThrustReading(0, 20.0), np.zeros(3)).speed_p_mps
    (2.0, 0.0, 0.0)
    """
    return lambda reading, _: SpeedReading(
        reading.time_ns, (section.advance_m * reading.revolutions_hz, 0.0, 0.0)
    )


class SpeedByForces:
    """The speed u at which forces τ drive a vehicle, along each axis with drag (Fossen 2021, Ch. 6 and 8).

    M u̇ = τ − B e_z − ω × M u − d u − q |u| u, with mass and added mass M, buoyancy less weight B and the angular rate ω
    of the gyros. Force and rate are linear between two readings; the first force is taken for a steady one. Steps are
    implicit in the drag, so that they are stable however fast the vehicle follows. What tilt, waves and a tether add is
    slip.

    >>> hull = SpeedByForces(EffortErrors(mass_kg=(20, 20, 20), quadratic_drag_kg_per_m=(100, 0, 0)))
    >>> [round(hull(EffortReading(time_ns, (force_n, 0.0, 0.0)), np.zeros(3)).speed_p_mps[0], 3)
    ...  for time_ns, force_n in ((0, 0.0), (500_000_000, 25.0), (10**10, 25.0))]
    [0.0, 0.269, 0.5]
    """

    def __init__(self, section: EffortErrors) -> None:
        self._mass_kg, self._buoyancy_n = np.array(section.mass_kg), section.buoyancy_n
        self._linear, self._quadratic = (
            np.array(section.linear_drag_kg_per_s),
            np.array(section.quadratic_drag_kg_per_m),
        )
        self._driven, self._most_n = np.array(section.driven), drag_beyond(section)
        self._time_ns: int | None = None
        self._force_n = self._omega_radps = self._speed_mps = np.zeros(3)

    def __call__(self, reading: EffortReading, omega_p_radps: Floats) -> SpeedReading:
        """The speed at a reading, which is later than those before; 0 along an axis without drag.

        Raises:
            KernelError: for one that is not, one beyond `drag_beyond`, and what is not finite; it is then as if it had
                not come.
        """
        for name, values, most, unit in (
            ("force_p_n", np.array(reading.force_p_n), self._most_n, f"N, the drag at {FASTEST_MPS:g} m/s"),
            ("omega_p_radps", omega_p_radps, np.full(3, np.finfo(float).max), "rad/s"),
        ):
            if not (np.abs(values) <= most).all():
                raise KernelError(
                    f"{name} at {reading.time_ns} ns is {np.asarray(values).tolist()}",
                    expected=f"numbers of at most {most.tolist()} {unit}",
                )
        force_n = np.array(reading.force_p_n) - (0.0, 0.0, self._buoyancy_n)
        if self._time_ns is None:
            self._speed_mps = self._steady(force_n, self._linear)
        elif reading.time_ns > self._time_ns:
            self._follow((reading.time_ns - self._time_ns) * 1e-9, force_n, omega_p_radps)
        else:
            raise KernelError(
                f"its time does not rise: {reading.time_ns} ns, and the last was {self._time_ns} ns",
                expected="forces in the order of their times",
            )
        self._time_ns, self._force_n, self._omega_radps = reading.time_ns, force_n, omega_p_radps
        surge, sway, heave = self._speed_mps.tolist()
        return SpeedReading(reading.time_ns, (surge, sway, heave))

    def _follow(self, duration_s: float, force_n: Floats, omega_radps: Floats) -> None:
        """The speed after a time in which force and rate have become these."""
        steps = min(math.ceil(duration_s / STEP_S), MOST_STEPS)
        by_inertia = self._mass_kg * (steps / duration_s)
        for step in range(steps):
            part = (step + 0.5) / steps
            force, omega = (
                (1.0 - part) * before + part * after
                for before, after in ((self._force_n, force_n), (self._omega_radps, omega_radps))
            )
            turning_n = _cross(omega, self._mass_kg * self._speed_mps)
            self._speed_mps = self._steady(
                force - turning_n + by_inertia * self._speed_mps, self._linear + by_inertia
            )

    def _steady(self, force_n: Floats, linear: Floats) -> Floats:
        """The speed at which q |u| u + d u is a force, solved without cancellation; 0 along an axis without drag."""
        below = linear + np.sqrt(linear**2 + 4.0 * self._quadratic * np.abs(force_n))
        return np.where(self._driven, 2.0 * force_n / np.where(below > 0.0, below, 1.0), 0.0)


def _cross(a: Floats, b: Floats) -> Floats:
    """The product a × b; numpy's takes longer than all of a step."""
    return a[[1, 2, 0]] * b[[2, 0, 1]] - a[[2, 0, 1]] * b[[1, 2, 0]]
