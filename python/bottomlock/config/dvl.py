"""The DVL as a filter takes it: its errors, and what is known beforehand of its mounting and clock."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from bottomlock import units
from bottomlock.config.section import PackagedOrFile, Section, in_si, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import Calibration, Finite, NonNegative, Positive, Real

SmallAngle = Annotated[Real, Field(ge=0, le=30, allow_inf_nan=False)]
"""1 sigma of a mounting angle, degrees: the filter is linear in it."""
ShortTime = Annotated[Real, Field(ge=0, lt=2, allow_inf_nan=False)]
"""1 sigma of a clock, seconds: the filter is linear in it."""


def _three(angles: object) -> object:
    """One value for each axis where one is given for all.

    Raises:
        ValueError: for anything else than one or three numbers from 0 to 30.
    """
    each = angles if isinstance(angles, list | tuple) else (angles,) * 3
    numbers = [one for one in each if isinstance(one, int | float) and not isinstance(one, bool)]
    if len(each) != 3 or len(numbers) != 3 or not all(0.0 <= one <= 30.0 for one in numbers):
        raise ValueError(
            f"is {angles!r}, expected one number or three (forward, right, down), 0 to 30 degrees"
        )
    return tuple(each)


Angles = Annotated[tuple[SmallAngle, SmallAngle, SmallAngle], BeforeValidator(_three)]


class StatedCalibration(Section):
    """How well a DVL's file knows it, 1 sigma; the mounting itself is `mounting_roll_deg` and the others there."""

    mounting_sd_deg: tuple[SmallAngle, SmallAngle, SmallAngle] = (0.0, 0.0, 0.0)
    """1 sigma of the mounting about the platform's forward, right and down axes"""
    scale_percent: Annotated[Real, Field(gt=-50, lt=50, allow_inf_nan=False)] = 0.0
    """so much too much the DVL reads"""
    scale_sd_percent: Annotated[Positive | None, shown(example=0.3)] = None
    """1 sigma of the scale; none: that of the case"""
    clock_offset_s: Finite = 0.0
    """to be added to the stamps of the DVL"""
    clock_sd_s: ShortTime = 0.0
    """1 sigma of the clock offset"""


class CalibrationSection(Section):
    """Mounting and clock of the DVL as states of the filter, 1 sigma beforehand.

    What is not given is that of the DVL's file, and 0 (certain) without. `mounting_sd_deg` is one value or three, about
    the platform's forward, right and down axes. The scale has its prior in `dvl.errors.scale_factor_percent`.
    """

    enabled: bool = True
    """whether mounting and clock are states of the filter"""
    mounting_sd_deg: Annotated[Angles | None, shown(example=1.0)] = None
    """1 sigma of the mounting, one value or three (forward, right, down); none: that of the DVL's file, 0 (certain)
    without"""
    clock_sd_s: Annotated[NonNegative | None, shown(example=0.1)] = None
    """1 sigma of the clock offset; none: that of the DVL's file, 0 (certain) without"""

    @model_validator(mode="after")
    def _short(self) -> Self:
        if self.clock_sd_s is not None and self.clock_sd_s >= 2.0:
            raise ValueError(
                f"clock_sd_s is {self.clock_sd_s:g}, expected less than 2 s: is it in milliseconds?"
            )
        if not self.enabled and (self.mounting_sd_deg is not None or self.clock_sd_s is not None):
            raise ValueError("enabled = false, but a prior is given; expected one of them")
        return self

    def prior(self, stated: StatedCalibration | None) -> Calibration:
        """The prior as the kernel takes it; `stated` is what the DVL's file says."""
        if not self.enabled:
            return Calibration()
        stated = StatedCalibration() if stated is None else stated
        angles = stated.mounting_sd_deg if self.mounting_sd_deg is None else self.mounting_sd_deg
        clock_s = stated.clock_sd_s if self.clock_sd_s is None else self.clock_sd_s
        return Calibration(mounting_sd_rad=tuple(np.deg2rad(angles).tolist()), clock_sd_s=clock_s)


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
    beam_noise_mps_per_m: Annotated[NonNegative | None, shown(example=5e-4)] = None
    """white noise that grows with the range of a beam, beside that, 1 sigma; none: the geometry's"""
    beam_noise_from: Annotated[Literal["geometry", "recording"], shown(example="recording")] = "geometry"
    """where the noise is from: geometry file, or the instrument's own figure of merit of each beam and ping"""
    errors: DvlErrors = DvlErrors()

    @model_validator(mode="after")
    def _noise_once(self) -> Self:
        for key in ("beam_noise_mps", "beam_noise_mps_per_m"):
            if self.beam_noise_from == "recording" and getattr(self, key) is not None:
                raise ValueError(f'beam_noise_from is "recording", and {key} is given: expected one of them')
        return self
