"""Errors and lever arms of depth, GPS and acoustic positions as a filter takes them; of a replay or live."""

from typing import Annotated, Any

from bottomlock.config.section import SensorErrors, Vector, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import NonNegative, Positive


class SlowDepthErrors(SensorErrors, kernel=models.DepthModel):
    """What a depth is off for longer than a reading: by the defaults 0.1 % of 200 m, in waters with a tide.

    The time is that of half a semidiurnal tide.
    """

    bias_m: NonNegative = 0.3
    bias_time_s: Positive = 21_600.0
    wave_m: NonNegative = 0.0
    wave_period_s: Positive = models.WAVE_PERIOD_S


class DepthErrors(SlowDepthErrors):
    """Noise and bias, 1 sigma, of a depth measured at `lever_arm_m` from the IMU."""

    sd_m: Annotated[Positive, shown(example=0.02)]
    """white noise, 1 sigma"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the sensor from the IMU, platform axes"""


class GpsErrors(SensorErrors, kernel=models.GpsModel):
    """Noise of GPS positions along north, east, down, 1 sigma, of an antenna at `lever_arm_m` from the IMU."""

    position_sd_m: tuple[Positive, Positive, Positive] = (2.0, 2.0, 4.0)
    """noise of north, east, down, 1 sigma"""
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the antenna from the IMU, platform axes"""

    def si(self) -> dict[str, Any]:
        """The velocities of the receiver, which are not used."""
        return {"velocity_sd_mps": (0.1, 0.1, 0.2)}


class AcousticPositionErrors(SensorErrors, kernel=models.AcousticPositionModel):
    """Noise of acoustic positions (USBL, LBL) of a transponder at `lever_arm_m` from the IMU (platform frame).

    1 sigma of each axis is the root of sd_m² + (sd_percent_of_range/100 · slant range)², the slant range from
    `transceiver_m` in the tangent frame, unless the readings state it.
    """

    sd_m: Positive = 0.5
    sd_percent_of_range: NonNegative = 1.0
    transceiver_m: Vector = (0.0, 0.0, 0.0)
    lever_arm_m: Vector = (0.0, 0.0, 0.0)
    """position of the transponder from the IMU, platform axes"""
