"""Noise of a motion that is made from attitudes, without inertial readings (docs/no_imu.md)."""

from typing import Annotated

from bottomlock import units
from bottomlock.config.meaning import shown
from bottomlock.config.scenario_sections import Section
from bottomlock.kernel.models import ImuModel, NonNegative, Positive

WEIGHTLESS_MPS2 = 0.0
"""Gravity of a filter whose specific forces are made without it."""


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

    def kernel_model(self, accel_noise_mps_rts: float, gyro_noise_rad_rts: float) -> ImuModel:
        """The errors in SI; what the section leaves out is given, in m/s/√s and rad/√s. There are no biases."""
        accel, gyro = self.accel_noise_mps_per_rt_h, self.gyro_noise_deg_per_rt_h
        if accel is not None:
            accel_noise_mps_rts = units.per_rt_s_from_per_rt_h(accel)
        if gyro is not None:
            gyro_noise_rad_rts = units.rad_from_deg(units.per_rt_s_from_per_rt_h(gyro))
        return ImuModel(
            accel_noise_mps_rts=accel_noise_mps_rts, gyro_noise_rad_rts=gyro_noise_rad_rts, accel_bias_sd_mps2=0.0,
            gyro_bias_sd_radps=0.0, accel_bias_walk_mps2_rts=0.0, gyro_bias_walk_radps_rts=0.0,
        )  # fmt: skip
