"""The platform's attitude from that of a sensor on it, by quaternions."""

import numpy as np
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.recordings.readings import AttitudeReading
from bottomlock.recordings.rotation import QUATERNION_ENU_NED, QUATERNION_FLU_FRD, product, quaternion

Floats = NDArray[np.float64]

_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


class PlatformAttitude:
    """Attitudes of the platform: the sensor's, out of its frames and its mounting, with its yaw offset added."""

    def __init__(self, section: AttitudeReference) -> None:
        angles = (section.mounting_roll_deg, section.mounting_pitch_deg, section.mounting_yaw_deg)
        self._after = np.array(quaternion(*map(units.rad_from_deg, angles))) * _CONJUGATE
        self._before = np.array(quaternion(0.0, 0.0, units.rad_from_deg(section.yaw_offset_deg)))
        if section.frame == "enu_flu":
            self._after = product(QUATERNION_FLU_FRD, self._after)
            self._before = product(self._before, QUATERNION_ENU_NED)

    def of(self, reading: AttitudeReading) -> Floats:
        """(4,) quaternion, scalar first, platform to north-east-down."""
        return product(self._before, product(np.array(reading.attitude_t_s), self._after))
