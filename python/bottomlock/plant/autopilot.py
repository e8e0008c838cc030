"""Four PID controllers (roll, pitch, yaw, speed) as differential equations, and the mixing to the four fins.

The integrators and derivative filters are states of the vehicle's equations, so that the commands are continuous in
time and the truth is smooth between the IMU's samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from bottomlock.plant.equations import Four, Three
from bottomlock.plant.maths import FloatArray, Maths, Number
from bottomlock.plant.vehicle import AttitudePid, SpeedPid, Vehicle


def attitude_pid(
    gains: AttitudePid, maths: Maths[Number]
) -> Callable[[Number, Number, Number, Number, Number], tuple[Number, Number, Number]]:
    """Build one attitude controller.

    The function takes the error (rad), the rate error (rad/s), the integral (rad s), the filtered rate error (rad/s)
    and the scale (cruise speed / speed)², and returns the equivalent fin angle (rad) and the derivatives of the two
    states. Anti-windup by back-calculation: the excess over the limit drives the integrator back over the tracking
    time (Åström and Hägglund 2006).
    """
    proportional, integral_gain, derivative = gains.proportional, gains.integral, gains.derivative
    limit, bleed, corner = (
        gains.limit,
        1.0 / (gains.tracking_time * gains.integral),
        1.0 / gains.derivative_filter,
    )
    clip = maths.clip

    def control(
        error: Number, rate: Number, integral: Number, filtered: Number, scale: Number
    ) -> tuple[Number, Number, Number]:
        wanted = (proportional * error + integral_gain * integral + derivative * filtered) * scale
        given = clip(wanted, -limit, limit)
        return given, error + bleed * (given - wanted) / scale, corner * (rate - filtered)

    return control


def speed_pid(
    gains: SpeedPid, max_shaft: float, maths: Maths[Number]
) -> Callable[[Number, Number, Number, Number, Number], tuple[Number, Number, Number]]:
    """Build the speed controller.

    The function takes the wanted speed (m/s), the speed error (m/s), the acceleration error (m/s²), the integral (m)
    and the filtered acceleration error (m/s²), and returns the shaft speed (rev/s) and the derivatives of the two
    states.
    """
    forward, proportional, integral_gain = gains.feed_forward, gains.proportional, gains.integral
    derivative, corner = gains.derivative, 1.0 / gains.derivative_filter
    bleed = 1.0 / (gains.tracking_time * gains.integral)
    clip = maths.clip

    def control(
        wanted: Number, error: Number, rate: Number, integral: Number, filtered: Number
    ) -> tuple[Number, Number, Number]:
        shaft = forward * wanted + proportional * error + integral_gain * integral + derivative * filtered
        given = clip(shaft, 0.0, max_shaft)
        return given, error + bleed * (given - shaft), corner * (rate - filtered)

    return control


@dataclass(frozen=True)
class Mixer:
    """Equivalent roll, pitch and yaw deflections to fins, and back.

    A deflection d_i of the fin at azimuth a_i acts as d_i in roll, d_i cos a_i in pitch and d_i sin a_i in yaw (see
    `fins`), so that the command for fin i is roll + cos a_i pitch + sin a_i yaw. For a regular cross, + or x, the three
    columns are orthogonal and the inverse is the least-squares one.
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


def fin_commands(vehicle: Vehicle) -> Callable[[Number, Number, Number], Four[Number]]:
    """Build the mixer on components: (roll, pitch, yaw) equivalent deflections to four fin commands, rad."""
    (_, c0, s0), (_, c1, s1), (_, c2, s2), (_, c3, s3) = (
        tuple(float(value) for value in row) for row in Mixer.of(vehicle).columns
    )

    def mix(roll: Number, pitch: Number, yaw: Number) -> Four[Number]:
        return (
            roll + c0 * pitch + s0 * yaw,
            roll + c1 * pitch + s1 * yaw,
            roll + c2 * pitch + s2 * yaw,
            roll + c3 * pitch + s3 * yaw,
        )

    return mix


Memory: TypeAlias = Sequence[Number]
"""Integral and filtered rate error of roll, pitch, yaw and speed, (8,)."""


def autopilot(
    vehicle: Vehicle, maths: Maths[Number]
) -> Callable[
    [Three[Number], Three[Number], Three[Number], Number, Memory[Number]],
    tuple[Four[Number], Number, tuple[Number, ...]],
]:
    """Build all four controllers.

    The function takes the errors of roll, pitch and heading (rad), their rate errors (rad/s), the wanted speed, its
    error and the acceleration error (m/s, m/s, m/s²), the speed ahead (m/s) and the memory (8,). It returns the fin
    commands (rad), the shaft command (rev/s) and the derivative of the memory (8,).
    """
    pilot, limits = vehicle.autopilot, vehicle.limits
    roll_pid, pitch_pid, yaw_pid = (
        attitude_pid(gains, maths) for gains in (pilot.roll, pilot.pitch, pilot.yaw)
    )
    speed_law = speed_pid(pilot.speed, vehicle.propeller.max_speed, maths)
    mix: Callable[[Number, Number, Number], Four[Number]] = fin_commands(vehicle)
    cruise, slowest, fastest = limits.cruise_speed, limits.min_speed, limits.max_speed
    clip = maths.clip

    def control(
        errors: Three[Number],
        rate_errors: Three[Number],
        speed: Three[Number],
        ahead: Number,
        memory: Memory[Number],
    ) -> tuple[Four[Number], Number, tuple[Number, ...]]:
        roll_i, roll_f, pitch_i, pitch_f, yaw_i, yaw_f, speed_i, speed_f = memory
        # the gains hold at cruise speed; fin forces grow with the speed squared
        scheduled = clip(ahead, slowest, fastest)
        scale = cruise * cruise / (scheduled * scheduled)
        roll_fin, roll_i_dot, roll_f_dot = roll_pid(errors[0], rate_errors[0], roll_i, roll_f, scale)
        pitch_fin, pitch_i_dot, pitch_f_dot = pitch_pid(errors[1], rate_errors[1], pitch_i, pitch_f, scale)
        yaw_fin, yaw_i_dot, yaw_f_dot = yaw_pid(errors[2], rate_errors[2], yaw_i, yaw_f, scale)
        shaft, speed_i_dot, speed_f_dot = speed_law(*speed, speed_i, speed_f)
        memory_dot = (
            roll_i_dot, roll_f_dot, pitch_i_dot, pitch_f_dot, yaw_i_dot, yaw_f_dot, speed_i_dot, speed_f_dot,
        )  # fmt: skip
        return mix(roll_fin, pitch_fin, yaw_fin), shaft, memory_dot

    return control
