"""An attitude or heading reference: its mounting, its errors, what a filter uses of it; of a replay or live."""

import math
from typing import Annotated, Literal

from pydantic import Field

from bottomlock import units
from bottomlock.config.instrument_grades import Graded, one_of
from bottomlock.config.section import Mounting, SensorErrors, in_si, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import NonNegative, Positive, Real

START_FACTOR = 3.0
"""1 sigma of a start over that of the reading it is from, where readings with the same slow error follow. The slow
error then counts twice by a tenth of its variance, and not by half."""


class SlowAttitudeErrors(SensorErrors, kernel=models.MagnetometerModel):
    """What an attitude is off for longer than a reading, 1 sigma: states of the filter unless 0."""

    roll_pitch_offset_sd_deg: NonNegative = 0.0
    yaw_offset_sd_deg: NonNegative = 0.0
    roll_pitch_walk_sd_deg: NonNegative = 0.0
    yaw_walk_sd_deg: NonNegative = 0.0
    walk_time_s: Positive = models.WALK_TIME_S
    yaw_semicircular_sd_deg: NonNegative = 0.0
    yaw_quadrantal_sd_deg: NonNegative = 0.0


class AttitudeReference(Graded, SlowAttitudeErrors, Mounting):
    """Mounting and errors of an attitude sensor.

    Of a reading's error `roll_pitch_sd_deg` and `yaw_sd_deg` are white noise, a constant offset and a first-order walk
    last: the filter estimates these two where they are given.
    """

    of_grade = ("attitude", "grade")
    grade: Annotated[str | None, shown(range=one_of("attitude"), example="mti_ahrs")] = None
    """packaged grade that gives the standard deviations and the walk time left out here; bottomlock list grades lists
    them"""
    frame: Literal["ned_frd", "enu_flu"] = "ned_frd"
    """frames of the angles: north-east-down to forward-starboard-down, or east-north-up to forward-port-up"""
    yaw_offset_deg: Annotated[Real, Field(ge=-360, le=360)] = 0.0
    """added to the yaw, for instance a declination"""
    aids: Literal["attitude", "heading", "nothing"] = "nothing"
    """what the filter uses of it; the alignment may use it in any case"""
    roll_pitch_sd_deg: Positive = 1.0
    yaw_sd_deg: Positive = 5.0

    @property
    def start_roll_pitch_sd_deg(self) -> float:
        """1 sigma of roll and pitch at a start from a reading, deg."""
        slow = math.hypot(self.roll_pitch_offset_sd_deg, self.roll_pitch_walk_sd_deg)
        return self._start_sd_deg(self.roll_pitch_sd_deg, slow, aided=self.aids == "attitude")

    @property
    def yaw_constant_sd_deg(self) -> float:
        """1 sigma of what stays of the yaw's error on a heading, deg: offset and deviation."""
        return math.hypot(self.yaw_offset_sd_deg, self.yaw_semicircular_sd_deg, self.yaw_quadrantal_sd_deg)

    @property
    def start_yaw_sd_deg(self) -> float:
        """1 sigma of the yaw at a start from a reading, deg."""
        slow = math.hypot(self.yaw_constant_sd_deg, self.yaw_walk_sd_deg)
        return self._start_sd_deg(self.yaw_sd_deg, slow, aided=self.aids != "nothing")

    def _start_sd_deg(self, white_deg: float, slow_deg: float, *, aided: bool) -> float:
        # The readings that follow have the slow error that the start has, and the filter takes the two for independent.
        repeated = START_FACTOR if aided and slow_deg > 0.0 else 1.0
        return repeated * math.hypot(white_deg, slow_deg)

    @property
    def gyro_noise_rad_rts(self) -> float:
        """White noise of gyros that these attitudes stand for: their error changes by its own 1 sigma in an hour."""
        return units.rad_from_deg(units.per_rt_s_from_per_rt_h(self.start_yaw_sd_deg))

    def replaces_inertial_readings(self) -> None:
        """Checks the section of a vehicle whose motion is made from these attitudes.

        Raises:
            ValueError: if it also aids.
        """
        if self.aids != "nothing":
            raise ValueError(
                f'attitude.aids is "{self.aids}", expected "nothing" with imu.source = "attitude": the same '
                "angles would count twice"
            )

    def kernel_models(self, gravity_mps2: float = math.nan) -> dict[str, models.Settings]:
        """The errors in SI, as the kernel names them: of the whole attitude, and of the heading alone."""
        yaw = {key.removeprefix("yaw_"): value for key, value in self if key != "yaw_offset_deg"}
        return super().kernel_models(gravity_mps2) | {"heading": in_si(yaw, models.HeadingModel)}
