"""Four PID controllers (roll, pitch, yaw, speed) as differential equations, the mixing to the fins, and their servos.

The integrators and derivative filters are states of the vehicle's equations, so that the commands are continuous in
time and the truth is smooth between the IMU's samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Generic, NamedTuple, Self, TypeAlias

import numpy as np

from bottomlock.plant.equations import Four, Three
from bottomlock.plant.guidance import depth_by_pitch
from bottomlock.plant.maths import FloatArray, Maths, Number
from bottomlock.plant.vehicle import AttitudePid, SpeedPid, Vehicle


@dataclass(frozen=True)
class StuckFin:
    """Fin `fin` (1 to 4) stays at `angle_rad` throughout, whatever its command."""

    fin: int
    angle_rad: float


def fin_servo(vehicle: Vehicle, maths: Maths[Number]) -> Callable[[Number, Number], Number]:
    """Build the rate of a fin (rad/s) from its command and its angle (rad).

    The command is clipped, then lagged, then rate-limited.
    """
    servo = vehicle.fin_actuator
    limit, rate, corner = servo.max_deflection, servo.max_rate, 1.0 / servo.time_constant
    clip = maths.clip

    def motion(command: Number, angle: Number) -> Number:
        return clip(corner * (clip(command, -limit, limit) - angle), -rate, rate)

    return motion


def thruster(vehicle: Vehicle, maths: Maths[Number]) -> Callable[[Number, Number], Number]:
    """Build the shaft's acceleration (rev/s²) from the commanded and the actual shaft speed (rev/s)."""
    prop = vehicle.propeller
    limit, rate, corner = prop.max_speed, prop.max_acceleration, 1.0 / prop.time_constant
    clip = maths.clip

    def motion(command: Number, shaft: Number) -> Number:
        return clip(corner * (clip(command, -limit, limit) - shaft), -rate, rate)

    return motion


def actuator_rates(
    vehicle: Vehicle, maths: Maths[Number], stuck: StuckFin | None
) -> Callable[[Four[Number], Four[Number], Number, Number], tuple[list[Number], Number]]:
    """Build the rates of all actuators.

    The function takes the fin commands and fin angles (rad) and the commanded and actual shaft speed (rev/s), and
    returns the fin rates (rad/s) and the shaft's acceleration (rev/s²). A stuck fin is held at its angle by a fast lag.
    """
    servo, motor = fin_servo(vehicle, maths), thruster(vehicle, maths)
    index = stuck.fin - 1 if stuck is not None else -1
    angle_rad = stuck.angle_rad if stuck is not None else 0.0

    def rates(
        commands: Four[Number], angles: Four[Number], shaft_command: Number, shaft: Number
    ) -> tuple[list[Number], Number]:
        fin_rates = [servo(command, angle) for command, angle in zip(commands, angles, strict=True)]
        if index >= 0:
            fin_rates[index] = 50.0 * (angle_rad - angles[index])
        return fin_rates, motor(shaft_command, shaft)

    return rates


class Motion(NamedTuple, Generic[Number]):
    """The motion that control uses, estimated but for the last two.

    Angles (rad), speeds in the level heading frame and over all (m/s), depth (m), sink rate (m/s), body rates (rad/s)
    and the acceleration ahead (m/s²).
    """

    roll: Number
    pitch: Number
    yaw: Number
    ahead: Number
    starboard: Number
    speed: Number
    depth: Number
    sink: Number
    rates: tuple[Number, Number, Number]
    surge_rate: Number


class Wanted(NamedTuple, Generic[Number]):
    """What guidance wants: course (rad), its rate (rad/s), speed over ground (m/s), depth (m) and sink rate (m/s)."""

    course: Number
    course_rate: Number
    speed: Number
    depth: Number
    sink: Number


Steer: TypeAlias = Callable[[Sequence[Number], Motion[Number], Wanted[Number]], list[Number]]
"""The rates of actuators and controllers from their state, the motion and what is wanted."""


def fin_steering(vehicle: Vehicle, maths: Maths[Number], stuck: StuckFin | None) -> Steer[Number]:
    """Build the rates of fins, shaft, autopilot and guidance, in the layout of `model`."""
    control, actuators = autopilot(vehicle, maths), actuator_rates(vehicle, maths, stuck)
    depth_law = depth_by_pitch(vehicle, maths)
    crab_corner = 1.0 / vehicle.guidance.crab_time_constant
    atan2, wrap = maths.atan2, maths.wrap

    def steer(own: Sequence[Number], motion: Motion[Number], wanted: Wanted[Number]) -> list[Number]:
        fin1, fin2, fin3, fin4, shaft = own[:5]
        memory, crab, depth_i = own[5:13], own[13], own[14]
        p, q, r = motion.rates
        pitch_wanted, depth_i_dot = depth_law(wanted.depth, wanted.sink, motion.depth, motion.speed, depth_i)
        fin_commands, shaft_command, memory_dot = control(
            (-motion.roll, pitch_wanted - motion.pitch, wrap(wanted.course - crab - motion.yaw)),
            (-p, -q, wanted.course_rate - r),
            (wanted.speed, wanted.speed - motion.speed, -motion.surge_rate),
            motion.ahead,
            memory,
        )
        fin_rates, shaft_rate = actuators(fin_commands, (fin1, fin2, fin3, fin4), shaft_command, shaft)
        crab_dot = crab_corner * (atan2(motion.starboard, motion.ahead) - crab)
        return list(chain(fin_rates, (shaft_rate,), memory_dot, (crab_dot, depth_i_dot)))

    return steer


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
