"""Beams of the DVL that the water returns, in a scenario."""

from typing import Annotated, Any, Literal

from bottomlock.config.meaning import shown
from bottomlock.config.mission_sections import CurrentTable
from bottomlock.config.scenario_sections import Factor, Fraction, Section
from bottomlock.kernel import models
from bottomlock.kernel.models import NonNegative, Positive


class WaterTrack(Section):
    """Water track: pings of the DVL return the velocity relative to the water in a cell, on every beam.

    Beam biases, scale factor, mounting and clock are those of the bottom's beams; losses, noise and outliers are the
    water's own. The current is that of the depth of each beam's cell. With the section every method but `ins` has the
    current as states. `current` is for a truth without a vehicle, whose motion over ground stays as it is; that of a
    vehicle stands in `[mission]`.
    """

    enabled: bool = True
    """whether the water returns beams; a section that is there is on unless it says otherwise"""
    pings: Literal["all", "without_bottom"] = "all"
    """which pings return the water: all of them, or those of which no beam returns from the bottom"""
    range_m: NonNegative = 10.0
    """distance along the beam from the transducer to the middle of the cell"""
    noise_mps: Positive = 0.05
    """white noise of each beam"""
    lost_fraction: Annotated[Fraction, shown(unit="1")] = 0.0
    """part of the readings of each beam that are lost"""
    outlier_fraction: Annotated[Fraction, shown(unit="1")] = 0.0
    """part of the readings of each beam that are outliers, such as fish; the filter does not model them"""
    outlier_factor: Annotated[Factor, shown(unit="1")] = 10.0
    """noise of an outlier over that of a good reading"""
    wake: Annotated[Fraction, shown(unit="1")] = 0.0
    """part of the vehicle's velocity relative to the water with which the water in the cell follows it; the filter
    does not model it"""
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
