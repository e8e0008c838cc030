"""Revolutions of the propeller, in a scenario: the speed through the water."""

from typing import Annotated, Literal

from pydantic import Field

from bottomlock import units
from bottomlock.config.scenario_sections import NonNegative, Positive, Section
from bottomlock.kernel import models


class Thrust(Section):
    """Revolutions of the propeller: the speed through the water along the vehicle's axis by its advance, and slip.

    With the section every method has the current as states. The filter expects `advance_m` with its uncertainty; a run
    draws its own about `error_percent` more, and a slip. `corrects` is what a reading corrects: "velocity" leaves
    attitude and biases alone. The water moves as for `[water_track]`.
    """

    enabled: bool = True
    rate_hz: Positive = 1.0
    advance_m: Positive = 0.1
    uncertainty_percent: NonNegative = 10.0
    error_percent: Annotated[float, Field(gt=-100, allow_inf_nan=False)] = 0.0
    slip_mps: Positive = 0.02
    slip_time_s: Positive = 5.0
    noise_mps: Positive = 0.01
    corrects: Literal["velocity", "all"] = "velocity"

    def kernel_model(self) -> models.ThrustModel:
        """The errors in SI."""
        return models.ThrustModel(
            advance_m=self.advance_m,
            advance_sd_m=self.advance_m * units.fraction_from_percent(self.uncertainty_percent),
            true_advance_m=self.advance_m * (1.0 + units.fraction_from_percent(self.error_percent)),
            slip_sd_mps=self.slip_mps,
            slip_time_s=self.slip_time_s,
            noise_sd_mps=self.noise_mps,
        )
