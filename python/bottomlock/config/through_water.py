"""Speed through the water by the propeller's revolutions, or by the forces of thrusters and the vehicle's drag."""

from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from bottomlock import units
from bottomlock.config.section import SensorErrors, Triple, Vector, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import Finite, NonNegative, Positive


class ThroughWaterErrors(SensorErrors, kernel=models.ThrustModel):
    """What revolutions and forces have in common: slip, and what a reading corrects."""

    slip_mps: Positive = 0.02
    slip_time_s: Positive = 5.0
    corrects: Literal["velocity", "all"] = "velocity"
    """what a reading corrects: the velocity, the current and the sensor's own errors alone, or all states"""

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return super().kernel_options() | {"thrust": self.corrects}


class ThrustErrors(ThroughWaterErrors, kernel=models.ThrustModel):
    """What a filter takes the revolutions of a propeller for: advance per revolution, slip and noise, 1 sigma."""

    advance_m: Annotated[Positive, shown(example=0.1)]
    uncertainty_percent: NonNegative = 10.0
    """what the filter expects of its error, and how simulated vehicles differ, 1 sigma"""
    noise_mps: Positive = 0.01

    def si(self) -> dict[str, Any]:
        """What is no key of the same name."""
        return {"advance_sd_m": self.advance_m * units.fraction_from_percent(self.uncertainty_percent)}


class EffortErrors(ThroughWaterErrors, kernel=models.EffortModel):
    """What a filter makes of the forces of thrusters: mass, drag, slip and noise, 1 sigma; surge, sway and heave each.

    An axis without drag is not used.
    """

    mass_kg: Annotated[Triple, shown(example=[19.9, 20.6, 32.2])]
    linear_drag_kg_per_s: Annotated[Triple, shown(example=[13.7, 0.0, 33.0])] = (0.0, 0.0, 0.0)
    quadratic_drag_kg_per_m: Annotated[Triple, shown(example=[141.0, 217.0, 190.0])] = (0.0, 0.0, 0.0)
    buoyancy_n: Finite = 0.0
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """the place that mass and drag refer to, platform frame"""
    uncertainty_percent: NonNegative = 10.0
    """of the speed at a force, 1 sigma: half of that of a quadratic drag, all of that of a linear one"""
    inertia_percent: NonNegative = 20.0
    noise_n: Positive = 1.0

    @model_validator(mode="after")
    def _has_drag(self) -> Self:
        drags = zip(self.linear_drag_kg_per_s, self.quadratic_drag_kg_per_m, strict=True)
        has_drag = [max(drag) > 0.0 for drag in drags]
        if not any(has_drag):
            raise ValueError(
                "linear_drag_kg_per_s and quadratic_drag_kg_per_m are 0: an axis needs one of them"
            )
        for axis, mass, has in zip(("surge", "sway", "heave"), self.mass_kg, has_drag, strict=True):
            if has and mass == 0.0:
                raise ValueError(f"mass_kg of {axis} is 0, expected mass and added mass: the axis has drag")
        return self

    def si(self) -> dict[str, Any]:
        """What is no key of the same name."""
        return {"speed_scale_sd": units.fraction_from_percent(self.uncertainty_percent)}


def require_one_use(thrust: ThrustErrors | None, effort: EffortErrors | None) -> None:
    """Raises ValueError where revolutions and forces are to correct different states: a filter has one use of both."""
    if thrust is not None and effort is not None and thrust.corrects != effort.corrects:
        raise ValueError(
            f'thrust.corrects is "{thrust.corrects}" and effort.corrects "{effort.corrects}", expected the same'
        )
