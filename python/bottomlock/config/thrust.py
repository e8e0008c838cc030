"""Revolutions of the propeller, in a scenario: the speed through the water."""

from typing import Annotated, Literal

from pydantic import Field

from bottomlock import units
from bottomlock.config.scenario_sections import NonNegative, Positive, Section
from bottomlock.kernel import models


class Thrust(Section):
    """Revolutions of the propeller: so many per metre through the water along the vehicle's axis, and slip.

    With the section every method has the current as states. The filter expects `revolutions_per_m` with their
    uncertainty; a run draws its own about `error_percent` more, and a slip. `corrects` is what a reading corrects:
    "velocity" leaves attitude and biases alone. The water moves as for `[water_track]`.
    """

    enabled: bool = True
    rate_hz: Positive = 1.0
    revolutions_per_m: Positive = 10.0
    uncertainty_percent: NonNegative = 10.0
    error_percent: Annotated[float, Field(gt=-100, allow_inf_nan=False)] = 0.0
    slip_mps: Positive = 0.02
    slip_time_s: Positive = 5.0
    noise_hz: Positive = 0.1
    corrects: Literal["velocity", "all"] = "velocity"

    def kernel_model(self) -> models.ThrustModel:
        """The errors in SI."""
        per_m = self.revolutions_per_m
        return models.ThrustModel(
            revolutions_per_m=per_m,
            revolutions_per_m_sd=per_m * units.fraction_from_percent(self.uncertainty_percent),
            true_revolutions_per_m=per_m * (1.0 + units.fraction_from_percent(self.error_percent)),
            slip_sd_hz=per_m * self.slip_mps,
            slip_time_s=self.slip_time_s,
            noise_sd_hz=self.noise_hz,
        )
