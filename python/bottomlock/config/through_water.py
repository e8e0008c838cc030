"""Speed through the water by what drives a vehicle: revolutions of its propeller, or forces of its thrusters."""

from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from bottomlock import units
from bottomlock.config.section import SensorErrors, Triple, Vector, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import Finite, NonNegative, Positive


class DriveErrors(SensorErrors, kernel=models.ThrustModel):
    """What revolutions and forces have in common: scale, slip and noise of the speed, 1 sigma, and what it corrects."""

    uncertainty_percent: NonNegative = 10.0
    """of the speed that the drives say, 1 sigma; of a vehicle's own, which a simulation draws"""
    slip_mps: Positive = 0.02
    slip_time_s: Positive = 5.0
    noise_mps: Positive = 0.01
    corrects: Literal["velocity", "all"] = "velocity"
    """what a reading corrects: the velocity, the current and the sensor's own errors alone, or all states"""

    @property
    def driven(self) -> tuple[bool, bool, bool]:
        """Whether surge, sway and heave are driven."""
        return True, False, False

    def si(self) -> dict[str, Any]:
        """What is no key of the same name."""
        scale_sd = units.fraction_from_percent(self.uncertainty_percent)
        return {
            "scale_sd": tuple(scale_sd * is_driven for is_driven in self.driven),
            "slip_sd_mps": tuple(self.slip_mps * is_driven for is_driven in self.driven),
        }

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return super().kernel_options() | {"thrust": self.corrects}


class ThrustErrors(DriveErrors):
    """What a filter takes the revolutions of a propeller for: advance per revolution, scale, slip and noise."""

    advance_m: Annotated[Positive, shown(example=0.1)]
    """speed through the water per revolution a second"""


class EffortErrors(DriveErrors):
    """What a filter takes the forces of thrusters for: mass, drag, scale, slip and noise; surge, sway and heave each.

    The speed is that which the forces drive the vehicle at (docs/howto/thrust.md). An axis without drag is not used.
    """

    mass_kg: Annotated[Triple, shown(example=[19.9, 20.6, 32.2])]
    """mass and added mass along surge, sway and heave"""
    linear_drag_kg_per_s: Annotated[Triple, shown(example=[13.7, 0.0, 33.0])] = (0.0, 0.0, 0.0)
    """drag over speed"""
    quadratic_drag_kg_per_m: Annotated[Triple, shown(example=[141.0, 217.0, 190.0])] = (0.0, 0.0, 0.0)
    """drag over speed squared"""
    buoyancy_n: Finite = 0.0
    """buoyancy less weight; negative for a vehicle that sinks"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """the place that mass and drag refer to, platform frame"""

    @model_validator(mode="after")
    def _has_drag(self) -> Self:
        if not any(self.driven):
            raise ValueError(
                "linear_drag_kg_per_s and quadratic_drag_kg_per_m are 0: an axis needs one of them"
            )
        for axis, mass_kg, has in zip(("surge", "sway", "heave"), self.mass_kg, self.driven, strict=True):
            if has and mass_kg == 0.0:
                raise ValueError(f"mass_kg of {axis} is 0, expected mass and added mass: the axis has drag")
        return self

    @property
    def driven(self) -> tuple[bool, bool, bool]:
        """Whether surge, sway and heave have drag."""
        drags = zip(self.linear_drag_kg_per_s, self.quadratic_drag_kg_per_m, strict=True)
        surge, sway, heave = (max(drag) > 0.0 for drag in drags)
        return surge, sway, heave


def require_one_drive(thrust: ThrustErrors | None, effort: EffortErrors | None) -> None:
    """Raises ValueError where both revolutions and forces are to say the speed: a filter has one scale of each axis."""
    if thrust is not None and effort is not None:
        raise ValueError(
            "[thrust] and [effort] are given, expected one of them: both say the speed through the water"
        )
