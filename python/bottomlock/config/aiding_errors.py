"""Errors and lever arms of depth, GPS and acoustic positions as a filter takes them; of a replay or live."""

from typing import Annotated, Any

from bottomlock import units
from bottomlock.config.meaning import shown
from bottomlock.config.scenario_sections import Section, Vector
from bottomlock.config.sensors import DEPTH_BIAS_M, DEPTH_BIAS_TIME_S
from bottomlock.kernel import models
from bottomlock.kernel.models import NonNegative, Positive


class DepthErrors(Section):
    """Noise, 1 sigma, of a depth measured at `lever_arm_m` from the IMU (platform frame), and its bias.

    `bias_m`, 1 sigma with the correlation time `bias_time_s`, is what the reading is off for hours: offset, tide,
    density, barometer. The filter estimates it.
    """

    sd_m: Annotated[Positive, shown(example=0.02)]
    """white noise, 1 sigma"""
    bias_m: NonNegative = DEPTH_BIAS_M
    """what the reading is off for hours, 1 sigma, which the filter estimates; 0 says nothing"""
    bias_time_s: Positive = DEPTH_BIAS_TIME_S
    """correlation time of the bias"""
    wave_m: NonNegative = 0.0
    """what waves add to the reading near the surface, 1 sigma, which the filter estimates; 0 says nothing"""
    wave_period_s: Positive = models.WAVE_PERIOD_S
    """mean period of the waves"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the sensor from the IMU, platform axes"""

    def kernel_models(self) -> dict[str, models.Settings]:
        """Section of the kernel's model, SI."""
        errors = models.DepthModel(
            sd_m=self.sd_m,
            bias_sd_m=self.bias_m,
            bias_time_s=self.bias_time_s,
            wave_sd_m=self.wave_m,
            wave_period_s=self.wave_period_s,
        )
        return {"depth": errors}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"levers": {"depth_p_m": self.lever_arm_m}}


class GpsErrors(Section):
    """Noise of GPS positions along north, east, down, 1 sigma, of an antenna at `lever_arm_m` from the IMU."""

    position_sd_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    """noise of north, east, down, 1 sigma"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the antenna from the IMU, platform axes"""

    def kernel_models(self) -> dict[str, models.Settings]:
        """Section of the kernel's model, SI."""
        return {"gps": models.GpsModel(position_sd_m=self.position_sd_m, velocity_sd_mps=(0.1, 0.1, 0.2))}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"levers": {"gps_p_m": self.lever_arm_m}}


class AcousticPositionErrors(Section):
    """Noise of acoustic positions (USBL, LBL) of a transponder at `lever_arm_m` from the IMU (platform frame).

    1 sigma of each axis is the root of sd_m² + (sd_percent_of_range/100 · slant range)², the slant range from
    `transceiver_m` in the tangent frame, unless the readings state it.
    """

    sd_m: Positive = 0.5
    """part of the noise that does not depend on range, each axis, 1 sigma"""
    sd_percent_of_range: NonNegative = 1.0
    """part of the noise that grows with the slant range, each axis, 1 sigma"""
    transceiver_m: Vector = (0.0, 0.0, 0.0)
    """position of the transceiver: north, east, down"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the transponder from the IMU, platform axes"""

    def kernel_models(self) -> dict[str, models.Settings]:
        """Section of the kernel's model, SI."""
        noise = models.AcousticPositionModel(
            sd_m=self.sd_m,
            sd_per_range=units.fraction_from_percent(self.sd_percent_of_range),
            transceiver_t_m=self.transceiver_m,
        )
        return {"acoustic_position": noise}

    def kernel_options(self) -> dict[str, Any]:
        """What it adds to the filter's options."""
        return {"levers": {"acoustic_position_p_m": self.lever_arm_m}}
