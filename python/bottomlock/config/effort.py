"""Forces of thrusters, the speed through the water by the vehicle's drag: mass, drag and their errors."""

from typing import Annotated, Any, Literal, Self

from pydantic import model_validator

from bottomlock import units
from bottomlock.config.meaning import shown
from bottomlock.config.scenario_sections import Section, Vector
from bottomlock.kernel import models
from bottomlock.kernel.models import Finite, NonNegative, Positive


class EffortErrors(Section):
    """What a filter makes of the forces of thrusters: mass, drag, slip and noise, 1 sigma; surge, sway and heave each.

    An axis without drag is not used.
    """

    mass_kg: Annotated[Vector, shown(unit="kg", example=[19.9, 20.6, 32.2])]
    """mass and added mass along surge, sway and heave"""
    linear_drag_kg_per_s: Annotated[Vector, shown(unit="N s/m", example=[13.7, 0.0, 33.0])] = (0.0, 0.0, 0.0)
    """drag over speed"""
    quadratic_drag_kg_per_m: Annotated[Vector, shown(unit="N s²/m²", example=[141.0, 217.0, 190.0])] = (
        0.0,
        0.0,
        0.0,
    )
    """drag over speed squared"""
    buoyancy_n: Annotated[Finite, shown(unit="N")] = 0.0
    """buoyancy less weight; negative for a vehicle that sinks"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """the place that mass and drag refer to, platform frame"""
    uncertainty_percent: NonNegative = 10.0
    """of the speed at a force, 1 sigma: half of that of a quadratic drag, all of that of a linear one"""
    inertia_percent: NonNegative = 20.0
    """of mass and added mass, 1 sigma"""
    slip_mps: Positive = 0.02
    """slip, 1 sigma: what waves, a tether and turns make of the speed at a force"""
    slip_time_s: Positive = 5.0
    """correlation time of the slip"""
    noise_n: Annotated[Positive, shown(unit="N")] = 1.0
    """white noise of a force"""
    corrects: Literal["velocity", "all"] = "velocity"
    """what a reading corrects: the velocity, speed at a force, slip, inertia and current alone, or all states"""

    @model_validator(mode="after")
    def _has_drag(self) -> Self:
        for key in ("mass_kg", "linear_drag_kg_per_s", "quadratic_drag_kg_per_m"):
            if min(getattr(self, key)) < 0.0:
                raise ValueError(f"{key} is {getattr(self, key)}, expected numbers of 0 or more")
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

    def kernel_models(self) -> dict[str, models.Settings]:
        """Section of the kernel's model, SI."""
        errors = models.EffortModel(
            mass_kg=self.mass_kg,
            linear_drag_kgps=self.linear_drag_kg_per_s,
            quadratic_drag_kgpm=self.quadratic_drag_kg_per_m,
            buoyancy_n=self.buoyancy_n,
            speed_scale_sd=units.fraction_from_percent(self.uncertainty_percent),
            inertia_sd=units.fraction_from_percent(self.inertia_percent),
            slip_sd_mps=self.slip_mps,
            slip_time_s=self.slip_time_s,
            noise_sd_n=self.noise_n,
        )
        return {"effort": errors}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"thrust": self.corrects, "levers": {"effort_p_m": self.lever_arm_m}}


def require_one_use(thrust: Any, effort: EffortErrors | None) -> None:  # noqa: ANN401 - the section of revolutions
    """Raises ValueError where revolutions and forces are to correct different states: a filter has one use of both."""
    if thrust is not None and effort is not None and thrust.corrects != effort.corrects:
        raise ValueError(
            f'thrust.corrects is "{thrust.corrects}" and effort.corrects "{effort.corrects}", expected the same'
        )
