"""Geometry, noise and errors of a DVL as a filter takes them, of a replay or live."""

from typing import Annotated, Literal, Self

from pydantic import model_validator

from bottomlock import units
from bottomlock.config.calibration import StatedCalibration
from bottomlock.config.section import PackagedOrFile, Section, in_si, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import NonNegative, Positive


class DvlErrors(Section, kernel=models.DvlModel):
    """Errors of the DVL that the filter assumes beside the beams' white noise, 1 sigma."""

    beam_bias_mps: NonNegative = 0.005
    beam_bias_walk_mps_per_rt_s: NonNegative = 5e-5
    scale_factor_percent: NonNegative = 0.7
    scale_factor_walk_percent_per_rt_s: NonNegative = 5e-3

    def kernel_model(self, beam_noise_sd_mps: float, stated: StatedCalibration | None) -> models.DvlModel:
        """The errors in SI, with the noise of a beam; a scale that is not given here is as the DVL's file states it."""
        scale_percent = self.scale_factor_percent
        if "scale_factor_percent" not in self.model_fields_set and stated is not None:
            scale_percent = stated.scale_sd_percent or scale_percent
        scale = units.fraction_from_percent(scale_percent)
        return in_si(dict(self), models.DvlModel, beam_noise_sd_mps=beam_noise_sd_mps, scale_factor_sd=scale)


class DvlSettings(Section):
    """The DVL: its geometry (packaged name or TOML file), the noise of its beams and the other errors, 1 sigma."""

    geometry: Annotated[str, PackagedOrFile, shown(example="waterlinked_a50")]
    """geometry of the DVL, packaged or a file"""
    beam_noise_mps: Annotated[Positive | None, shown(example=0.02)] = None
    """white noise of a beam, 1 sigma; none: the geometry's"""
    beam_noise_from: Annotated[Literal["geometry", "recording"], shown(example="recording")] = "geometry"
    """where the noise is from: geometry file, or the instrument's own figure of merit of each beam and ping"""
    errors: DvlErrors = DvlErrors()

    @model_validator(mode="after")
    def _noise_once(self) -> Self:
        if self.beam_noise_from == "recording" and self.beam_noise_mps is not None:
            raise ValueError(
                'beam_noise_from is "recording", and beam_noise_mps is given: expected one of them'
            )
        return self
