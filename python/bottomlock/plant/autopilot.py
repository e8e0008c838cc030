"""Four PID controllers (roll, pitch, yaw, speed) as differential equations, and the mixing to the four fins.

The integrators and derivative filters are states of the vehicle's own equations, so the commands are
continuous in time and the truth stays smooth between the IMU's samples.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from bottomlock.plant.equations import Four
from bottomlock.plant.lanes import FloatArray, Lane, Maths
from bottomlock.plant.vehicle import AttitudePid, SpeedPid, Vehicle


def attitude_pid(
    gains: AttitudePid, maths: Maths[Lane]
) -> Callable[[Lane, Lane, Lane, Lane, Lane], tuple[Lane, Lane, Lane]]:
    """Build one attitude controller.

    The function takes the error (rad), the rate error (rad/s), the integral (rad s), the filtered rate
    error (rad/s) and the scale (cruise speed / speed)², and returns the equivalent fin angle (rad) and the
    derivatives of the two states. Anti-windup by back-calculation: the limit's overshoot bleeds the
    integrator over the tracking time (Åström and Hägglund 2006).
    """
    proportional, integral_gain, derivative = gains.proportional, gains.integral, gains.derivative
    limit, bleed, corner = (
        gains.limit,
        1.0 / (gains.tracking_time * gains.integral),
        1.0 / gains.derivative_filter,
    )
    clip = maths.clip

    def control(
        error: Lane, rate: Lane, integral: Lane, filtered: Lane, scale: Lane
    ) -> tuple[Lane, Lane, Lane]:
        wanted = (proportional * error + integral_gain * integral + derivative * filtered) * scale
        given = clip(wanted, -limit, limit)
        return given, error + bleed * (given - wanted) / scale, corner * (rate - filtered)

    return control


def speed_pid(
    gains: SpeedPid, max_shaft: float, maths: Maths[Lane]
) -> Callable[[Lane, Lane, Lane, Lane, Lane], tuple[Lane, Lane, Lane]]:
    """Build the speed controller.

    The function takes the wanted speed (m/s), the speed error (m/s), the acceleration error (m/s²), the
    integral (m) and the filtered acceleration error, and returns the shaft speed (rev/s) and the
    derivatives of the two states.
    """
    forward, proportional, integral_gain = gains.feed_forward, gains.proportional, gains.integral
    derivative, corner = gains.derivative, 1.0 / gains.derivative_filter
    bleed = 1.0 / (gains.tracking_time * gains.integral)
    clip = maths.clip

    def control(
        wanted: Lane, error: Lane, rate: Lane, integral: Lane, filtered: Lane
    ) -> tuple[Lane, Lane, Lane]:
        shaft = forward * wanted + proportional * error + integral_gain * integral + derivative * filtered
        given = clip(shaft, 0.0, max_shaft)
        return given, error + bleed * (given - shaft), corner * (rate - filtered)

    return control


@dataclass(frozen=True)
class Mixer:
    """Fins to roll, pitch and yaw, and back.

    A deflection of fin i at azimuth a_i acts as d_i in roll, d_i cos a_i in pitch and d_i sin a_i in yaw
    (see `fins`), so the command for fin i is roll + cos a_i pitch + sin a_i yaw. For a regular cross, + or
    x, the three columns are orthogonal and the inverse is the least-squares one.
    """

    columns: FloatArray

    @classmethod
    def of(cls, vehicle: Vehicle) -> Self:
        """The mixer of a vehicle's fins."""
        azimuth = np.asarray(vehicle.fins.azimuth)
        return cls(np.stack([np.ones_like(azimuth), np.cos(azimuth), np.sin(azimuth)], axis=1))

    def fins_rad(self, modes_rad: FloatArray) -> FloatArray:
        """Fin deflections (..., 4) from equivalent roll, pitch and yaw deflections (..., 3), rad."""
        return np.asarray(modes_rad @ self.columns.T)

    def modes_rad(self, fins_rad: FloatArray) -> FloatArray:
        """Equivalent roll, pitch and yaw deflections (..., 3) from fin deflections (..., 4), rad."""
        return np.asarray(fins_rad @ np.linalg.pinv(self.columns).T)


def fin_commands(vehicle: Vehicle) -> Callable[[Lane, Lane, Lane], Four[Lane]]:
    """Build the mixer on components: (roll, pitch, yaw) equivalent deflections to four fin commands, rad."""
    (_, c0, s0), (_, c1, s1), (_, c2, s2), (_, c3, s3) = (
        tuple(float(value) for value in row) for row in Mixer.of(vehicle).columns
    )

    def mix(roll: Lane, pitch: Lane, yaw: Lane) -> Four[Lane]:
        return (
            roll + c0 * pitch + s0 * yaw,
            roll + c1 * pitch + s1 * yaw,
            roll + c2 * pitch + s2 * yaw,
            roll + c3 * pitch + s3 * yaw,
        )

    return mix
