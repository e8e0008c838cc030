"""Errors of an IMU and the limits of its readings; the noise of a motion made from attitudes in their place."""

import math
from typing import Annotated, Final, Literal

from pydantic import Field

from bottomlock import units
from bottomlock.config.instrument_grades import Graded, one_of
from bottomlock.config.section import Section, in_si, shown
from bottomlock.kernel import models
from bottomlock.kernel.models import NonNegative, Positive, Real, Whole

WEIGHTLESS_MPS2 = 0.0
"""Gravity of a filter whose specific forces are made without it."""


class ImuErrors(Graded, Section, kernel=models.ImuModel):
    """Errors of inertial sensors, 1 sigma; those of a packaged grade where `grade` names one and a key is left out."""

    of_grade = ("imu", "grade")
    grade: Annotated[str | None, shown(range=one_of("imu"), example="mti")] = None
    """packaged grade that gives the keys left out here; bottomlock list grades lists them"""
    accel_bias_mg: Annotated[NonNegative, shown(example=0.5)]
    gyro_bias_deg_per_h: Annotated[NonNegative, shown(example=3.0)]
    accel_noise_mps_per_rt_h: Annotated[NonNegative, shown(example=0.072)]
    gyro_noise_deg_per_rt_h: Annotated[NonNegative, shown(example=0.34)]
    accel_bias_walk_mps2_per_rt_s: NonNegative = 0.0
    gyro_bias_walk_deg_per_s_per_rt_s: NonNegative = 0.0
    gyro_scale_ppm: NonNegative = 0.0
    gyro_misalignment_mrad: NonNegative = 0.0
    gyro_g_sensitivity_deg_per_h_per_g: NonNegative = 0.0
    accel_scale_ppm: NonNegative = 0.0
    accel_warm_up_mg: NonNegative = 0.0
    gyro_warm_up_deg_per_h: NonNegative = 0.0
    warm_up_time_s: Positive = models.WALK_TIME_S

    def kernel_model(self) -> models.ImuModel:
        """The errors in SI."""
        return in_si(dict(self), models.ImuModel)


_LIMITS: Final = models.ImuLimits()


class ImuLimits(Section, kernel=models.ImuLimits):
    """What readings of a live navigator or a recorded log are checked against; simulated ones are not.

    The last of `stuck_after` equal readings is rejected (docs/imu_faults.md).
    """

    max_rate_deg_per_s: Annotated[Real, Field(gt=0, le=1e6)] = math.degrees(_LIMITS.max_rate_radps)
    max_force_mps2: Annotated[Real, Field(gt=0, le=1e6)] = _LIMITS.max_force_mps2
    stuck_after: Annotated[Whole, Field(ge=0, le=1_000_000), shown(unit="1")] = _LIMITS.stuck_after
    max_gap_s: Annotated[Real, Field(gt=0, le=1e6)] = _LIMITS.max_gap_s
    gap: Literal["refuse", "inflate"] = _LIMITS.gap
    gap_rate_deg_per_s: NonNegative = math.degrees(_LIMITS.gap_rate_sd_radps)
    gap_accel_mps2: NonNegative = _LIMITS.gap_accel_sd_mps2

    def kernel_limits(self) -> models.ImuLimits:
        """The limits in SI."""
        return in_si(dict(self), models.ImuLimits)


class Imu(ImuErrors):
    """Inertial measurement unit: rate, errors, and the limits of its readings outside a simulation."""

    rate_hz: Annotated[Real, Field(ge=1, le=10_000)] = 150.0
    """rate of the readings"""
    sampling: Literal["instantaneous", "averaged"] = "instantaneous"
    """whether a reading is of its moment, or the mean over the interval before it"""
    limits: ImuLimits = ImuLimits()


class MotionErrors(Section):
    """White noise of a motion made from attitudes, 1 sigma; what is left out is found from the file and its log.

    `accel_noise_mps_per_rt_h` is that of the vehicle's own accelerations, which nothing measures: of a log it is found
    by the changes from one complete ping to later ones. `gyro_noise_deg_per_rt_h` says how the error of the attitude
    changes: by the 1 sigma of its yaw in an hour if it is left out.
    """

    accel_noise_mps_per_rt_h: Annotated[Positive | None, shown(example=1.5)] = None
    """white noise of the vehicle's own accelerations, 1 sigma; none: measured on the log"""
    gyro_noise_deg_per_rt_h: Annotated[NonNegative | None, shown(example=2.0)] = None
    """how the error of the attitude changes, 1 sigma; none: by the 1 sigma of the yaw an hour"""

    def kernel_model(self, accel_noise_mps_rts: float, gyro_noise_rad_rts: float) -> models.ImuModel:
        """The errors in SI; what the section leaves out is given, in m/s/√s and rad/√s. There are no biases."""
        accel, gyro = self.accel_noise_mps_per_rt_h, self.gyro_noise_deg_per_rt_h
        if accel is not None:
            accel_noise_mps_rts = units.per_rt_s_from_per_rt_h(accel)
        if gyro is not None:
            gyro_noise_rad_rts = units.rad_from_deg(units.per_rt_s_from_per_rt_h(gyro))
        return models.ImuModel(
            accel_noise_mps_rts=accel_noise_mps_rts, gyro_noise_rad_rts=gyro_noise_rad_rts, accel_bias_sd_mps2=0.0,
            gyro_bias_sd_radps=0.0, accel_bias_walk_mps2_rts=0.0, gyro_bias_walk_radps_rts=0.0,
        )  # fmt: skip


UNKNOWN_RAD = math.radians(60.0)
"""1 sigma of the heading at the start from which it is unknown."""
GOOD_GYROS = 0.3
"""1 sigma of the gyros' offsets over the Earth's rate up to which they may tell the heading: 5 deg/h."""


def without_gyrocompass(model: models.Model) -> models.Model:
    """The model where the heading is unknown and the gyros are no better than the Earth's rate; else as it is.

    That rate then counts as a part of the gyros' offsets: its level part turns with the heading, and linear in an error
    of 180 degrees it would tell a heading that it does not know.
    """
    offset_radps, earth_radps = model.imu.gyro_bias_sd_radps, model.environment.earth_rate_radps
    if model.initial.attitude_sd_rad[2] <= UNKNOWN_RAD or offset_radps <= GOOD_GYROS * earth_radps:
        return model
    return model.replace(
        environment=model.environment.replace(earth_rate_radps=0.0),
        imu=model.imu.replace(gyro_bias_sd_radps=math.hypot(offset_radps, earth_radps)),
    )
