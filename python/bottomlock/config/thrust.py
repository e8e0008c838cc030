"""Revolutions of the propeller, the speed through the water: their errors, of a log or a scenario."""

from typing import Annotated, Any, Literal

from pydantic import Field

from bottomlock import units
from bottomlock.config.meaning import shown
from bottomlock.config.scenario_sections import Section
from bottomlock.kernel import models
from bottomlock.kernel.models import NonNegative, Positive


class ThrustErrors(Section):
    """What a filter takes the revolutions of a propeller for: advance per revolution, slip and noise, 1 sigma."""

    advance_m: Annotated[Positive, shown(example=0.1)]
    """advance per revolution that the filter expects"""
    uncertainty_percent: NonNegative = 10.0
    """what the filter expects of its error, and how simulated vehicles differ, 1 sigma"""
    slip_mps: Positive = 0.02
    """slip, 1 sigma: what waves, turns and changes of speed make of advance times revolutions"""
    slip_time_s: Positive = 5.0
    """correlation time of the slip"""
    noise_mps: Positive = 0.01
    """white noise of a reading, as a speed"""
    corrects: Literal["velocity", "all"] = "velocity"
    """what a reading corrects: the velocity, advance, slip and current alone, or all states"""

    def kernel_model(self) -> models.ThrustModel:
        """The errors in SI."""
        return models.ThrustModel(
            advance_m=self.advance_m,
            advance_sd_m=self.advance_m * units.fraction_from_percent(self.uncertainty_percent),
            slip_sd_mps=self.slip_mps,
            slip_time_s=self.slip_time_s,
            noise_sd_mps=self.noise_mps,
        )

    def kernel_models(self) -> dict[str, models.Settings]:
        """Section of the kernel's model, SI."""
        return {"thrust": self.kernel_model()}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"thrust": self.corrects}


class Thrust(ThrustErrors):
    """Revolutions of the propeller: the speed through the water along the vehicle's axis by its advance, and slip.

    With the section every method has the current as states. A run draws its own advance about `error_percent` more. The
    water moves as for `[water_track]`.
    """

    enabled: bool = True
    """whether revolutions are measured; a section that is there is on unless it says otherwise"""
    rate_hz: Positive = 1.0
    """readings a second"""
    advance_m: Positive = 0.1
    """advance per revolution that the filter expects"""
    error_percent: Annotated[float, Field(gt=-100, allow_inf_nan=False)] = 0.0
    """by how much vehicles advance more on average; the filter does not model it"""

    def kernel_model(self) -> models.ThrustModel:
        """The errors in SI, with those of simulated vehicles."""
        true_advance_m = self.advance_m * (1.0 + units.fraction_from_percent(self.error_percent))
        return super().kernel_model().replace(true_advance_m=true_advance_m)

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return super().kernel_options() if self.enabled else {"thrust": "off"}
