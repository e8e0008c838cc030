"""The velocity through the water by a kinetic model of the vehicle: drag, lift, thrust and fins, at measured rates.

The equations are those of the plant (docs/plant.md), with coefficients that are wrong by a stated amount, so that the
model is not the truth itself. Attitude and rates are taken from the navigation, as in Hegrenæs and Hallingstad 2011;
the three velocities through the water are integrated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.plant.autopilot import Mixer
from bottomlock.plant.equations import acceleration
from bottomlock.plant.maths import SCALAR
from bottomlock.plant.vehicle import Vehicle

Floats = NDArray[np.float64]

COEFFICIENTS = {
    "hull": ("axial_drag", "lift", "cross_flow_drag"),
    "added_mass": ("x_udot", "y_vdot", "z_wdot"),
    "fins": ("lift_slope",),
    "propeller": ("thrust_at_rest", "thrust_slope"),
}
"""Those that are wrong: what drives and holds back the three velocities."""


@dataclass(frozen=True, eq=False)
class Controls:
    """What a vehicle's controller knows: angles of the four fins (n, 4), rad, and speed of the shaft (n,), rev/s."""

    time_ns: NDArray[np.int64]
    fins_rad: Floats
    shaft_rps: Floats

    def at(self, time_ns: int) -> tuple[Floats, float]:
        """The last ones before or at a time."""
        row = max(int(np.searchsorted(self.time_ns, time_ns, side="right")) - 1, 0)
        return self.fins_rad[row], float(self.shaft_rps[row])


def perturbed(vehicle: Vehicle, sd: float, seed: int) -> Vehicle:
    """The vehicle with every one of `COEFFICIENTS` wrong by a factor 1 + sd · a normal number.

    >>> from bottomlock.plant import load_vehicle
    >>> tauv = load_vehicle("tauv")
    >>> perturbed(tauv, 0.1, 1).hull.axial_drag != tauv.hull.axial_drag
    True
    """
    draw = np.random.default_rng(seed)
    tables = {}
    for table, names in COEFFICIENTS.items():
        before = getattr(vehicle, table)
        changed = {name: getattr(before, name) * (1.0 + sd * float(draw.standard_normal())) for name in names}
        tables[table] = before.model_copy(update=changed)
    return vehicle.model_copy(update=tables)


class KineticModel:
    """Surge, sway and heave through the water, integrated."""

    def __init__(self, vehicle: Vehicle, gravity_mps2: float, velocity_p_mps: Floats) -> None:
        self.nu_dot = acceleration(vehicle, gravity_mps2, SCALAR)
        self.mixer = Mixer.of(vehicle)
        self.velocity_p_mps = np.array(velocity_p_mps, dtype=np.float64)
        self.modes_rad = np.zeros(3)

    def advance(
        self, attitude: Floats, omega_p_radps: Floats, fins_rad: Floats, shaft_rps: float, duration_s: float
    ) -> None:
        """Over a short time, by the midpoint rule; attitude (4,) scalar first."""

        def rate(velocity: Floats) -> Floats:
            return self._rates(velocity, attitude, omega_p_radps, fins_rad, shaft_rps)[:3]

        middle = self.velocity_p_mps + 0.5 * duration_s * rate(self.velocity_p_mps)
        self.velocity_p_mps = self.velocity_p_mps + duration_s * rate(middle)

    def fins_that_turn(
        self, attitude: Floats, omega_p_radps: Floats, alpha_p_radps2: Floats, shaft_rps: float
    ) -> Floats:
        """Angles of the fins (4,) with which the model has an angular acceleration: one Newton step from the last ones.

        For a vehicle whose commands are not known; the gyros show what the fins did.
        """
        step = 1e-3

        def turning(modes: Floats) -> Floats:
            fins = self.mixer.fins_rad(modes)
            return self._rates(self.velocity_p_mps, attitude, omega_p_radps, fins, shaft_rps)[3:]

        now = turning(self.modes_rad)
        slope = np.stack([(turning(self.modes_rad + step * one) - now) / step for one in np.eye(3)], axis=1)
        limit = 0.3
        self.modes_rad = np.clip(self.modes_rad + np.linalg.solve(slope, alpha_p_radps2 - now), -limit, limit)
        return np.asarray(self.mixer.fins_rad(self.modes_rad), dtype=np.float64)

    def _rates(
        self, velocity: Floats, attitude: Floats, omega: Floats, fins: Floats, shaft_rps: float
    ) -> Floats:
        nu = (*velocity.tolist(), *omega.tolist())
        still = (0.0, 0.0, 0.0)
        return np.array(self.nu_dot(tuple(attitude.tolist()), nu, (*fins.tolist(), shaft_rps), still, still))
