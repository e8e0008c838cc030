"""Beams of the DVL that the water returns, in a scenario."""

from typing import Any, Literal

from bottomlock.config.mission_sections import CurrentTable
from bottomlock.config.scenario_sections import Factor, Fraction, NonNegative, Positive, Section
from bottomlock.kernel import models


class WaterTrack(Section):
    """Water track: pings of the DVL return the velocity relative to the water in a cell, on every beam.

    Beam biases, scale factor, mounting and clock are those of the bottom's beams; losses, noise and outliers are the
    water's own. The current is that of the depth of each beam's cell. With the section every method but `ins` has the
    current as states. `current` is for a truth without a vehicle, whose motion over ground stays as it is; that of a
    vehicle stands in `[mission]`.
    """

    enabled: bool = True
    pings: Literal["all", "without_bottom"] = "all"
    range_m: NonNegative = 10.0
    noise_mps: Positive = 0.05
    lost_fraction: Fraction = 0.0
    outlier_fraction: Fraction = 0.0
    outlier_factor: Factor = 10.0
    wake: Fraction = 0.0
    current: CurrentTable = CurrentTable()

    def kernel_model(self) -> models.WaterTrackModel | None:
        """The errors in SI; None where it is off."""
        if not self.enabled:
            return None
        return models.WaterTrackModel(
            beam_noise_sd_mps=self.noise_mps,
            range_m=self.range_m,
            outlier_fraction=self.outlier_fraction,
            outlier_factor=self.outlier_factor,
            lost_fraction=self.lost_fraction,
            wake=self.wake,
        )

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"water_track": self.enabled}
