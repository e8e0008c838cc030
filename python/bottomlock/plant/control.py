"""Guidance and control as differential equations: from the estimated motion to the rates of the actuators.

Two laws for the horizontal plane: line of sight with look-ahead along the path, and constant bearing to a target that
moves along it (Breivik and Fossen 2009). In the vertical plane a vehicle with fins follows a depth profile by pitch. It
has four controllers (roll, pitch, yaw, speed), one with thrusters six. The integrators and derivative filters are
states of the vehicle's equations, so that the commands are continuous in time and the truth is smooth between the IMU's
samples.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, TypeAlias

import numpy as np

from bottomlock.plant.hovering_vehicle import AnglePid, AnyVehicle, HoveringVehicle, VelocityPi
from bottomlock.plant.maths import FloatArray, Maths, Number, Three
from bottomlock.plant.vehicle import AttitudePid, SpeedPid, Vehicle

Law: TypeAlias = Literal["line_of_sight", "constant_bearing"]
Segment: TypeAlias = Sequence[Number]
"""Start of the present segment (north, east, cos, sin, heading, curvature), that of the next, and the blend's length
(m)."""

Course: TypeAlias = tuple[Number, Number, Number]
"""Wanted course (rad), its rate (rad/s) and speed over ground (m/s)."""

Guide: TypeAlias = Callable[[Number, Number, Segment[Number], Sequence[Number]], Course[Number]]
"""A law: (north, east, segment, target) -> course, of a target (north, east, velocity north and east, course rate)."""


def offset_and_heading(
    north: Number, east: Number, start: Sequence[Number] | Sequence[float], maths: Maths[Number]
) -> tuple[Number, Number]:
    """Signed distance to the right of a line or arc (m), and the path's heading abeam of the vehicle (rad).

    The start is (north, east, cos, sin, heading, curvature); curvature 0 is a straight line, positive curves right.
    One formula serves both: e = (2 b - k (a² + b²)) / (1 + S), S² = (k a)² + (1 - k b)², with a the distance along the
    start's heading and b across it.
    """
    start_n, start_e, cosine, sine, heading, curvature = start
    delta_n, delta_e = north - start_n, east - start_e
    along = cosine * delta_n + sine * delta_e
    beside = cosine * delta_e - sine * delta_n
    forward, inward = curvature * along, 1.0 - curvature * beside
    distance = maths.sqrt(forward * forward + inward * inward)
    offset = (2.0 * beside - curvature * (along * along + beside * beside)) / (1.0 + distance)
    return offset, heading + maths.atan2(forward, inward)


def line_of_sight(vehicle: AnyVehicle, speed_mps: float, maths: Maths[Number]) -> Guide[Number]:
    """Build line of sight.

    The courses of the present and the next segment are blended over the joint by a smooth step of the distance past
    it, so that the command is continuous and independent of the instant at which the next pair of segments is used.
    """
    ahead = vehicle.guidance.look_ahead
    atan2, clip, wrap = maths.atan2, maths.clip, maths.wrap

    def law(
        north: Number, east: Number, segment: Segment[Number], _target: Sequence[Number]
    ) -> Course[Number]:
        offset, heading = offset_and_heading(north, east, segment[:6], maths)
        course = heading + atan2(-offset, ahead + 0.0 * offset)
        offset, heading = offset_and_heading(north, east, segment[6:12], maths)
        following = heading + atan2(-offset, ahead + 0.0 * offset)
        curvature0, (n1, e1, cos1, sin1, _, curvature1, blend) = segment[5], segment[6:]
        x = clip((cos1 * (north - n1) + sin1 * (east - e1)) / blend + 0.5, 0.0, 1.0)
        weight = x * x * (3.0 - 2.0 * x)
        course = course + weight * wrap(following - course)
        curvature = curvature0 + weight * (curvature1 - curvature0)
        return course, speed_mps * curvature, speed_mps + 0.0 * offset

    return law


def constant_bearing(vehicle: AnyVehicle, maths: Maths[Number]) -> Guide[Number]:
    """Build constant bearing: the wanted velocity is the target's plus an approach velocity towards it.

    The approach speed grows to its limit with distance over the look-ahead (Breivik and Fossen 2009).
    """
    ahead2 = vehicle.guidance.look_ahead**2
    approach, ceiling = vehicle.guidance.approach_speed, vehicle.limits.max_speed
    floor = vehicle.limits.min_speed
    sqrt, atan2, clip = maths.sqrt, maths.atan2, maths.clip

    def law(
        north: Number, east: Number, _segment: Segment[Number], target: Sequence[Number]
    ) -> Course[Number]:
        target_n, target_e, velocity_n, velocity_e, rate = target
        gap_n, gap_e = target_n - north, target_e - east
        pull = approach / sqrt(gap_n * gap_n + gap_e * gap_e + ahead2)
        wanted_n, wanted_e = velocity_n + pull * gap_n, velocity_e + pull * gap_e
        speed = sqrt(wanted_n * wanted_n + wanted_e * wanted_e)
        return atan2(wanted_e, wanted_n), rate, clip(speed, floor, ceiling)

    return law


def depth_by_pitch(
    vehicle: Vehicle, maths: Maths[Number]
) -> Callable[[Number, Number, Number, Number, Number], tuple[Number, Number]]:
    """Build the depth loop: (wanted depth, sink rate, depth, speed, integral) -> (pitch, integral's rate).

    Pitch is minus the arcsine of the wanted sink rate over the speed. The integral (m s) holds the trim pitch that
    buoyancy and angle of attack need; at the pitch limit anti-windup acts as in the attitude controllers.
    """
    gains = vehicle.guidance
    gain, integral_gain = gains.depth_gain, gains.depth_integral
    steepest, floor = gains.max_pitch, vehicle.limits.min_speed
    ceiling = vehicle.limits.max_speed
    bleed = gain / integral_gain
    clip, asin, sin = maths.clip, maths.asin, maths.sin

    def law(
        wanted: Number, sink: Number, depth: Number, speed: Number, integral: Number
    ) -> tuple[Number, Number]:
        error = wanted - depth
        rate = sink + gain * error + integral_gain * integral
        pace = clip(speed, floor, ceiling)
        pitch = -asin(clip(rate / pace, -0.99, 0.99))
        given = clip(pitch, -steepest, steepest)
        return given, error + bleed * (rate + pace * sin(given)) * (-1.0)

    return law


@dataclass(frozen=True)
class StuckFin:
    """Fin `fin` (1 to 4) stays at `angle_rad` throughout, whatever its command."""

    fin: int
    angle_rad: float


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
    rates: Three[Number]
    surge_rate: Number


class Wanted(NamedTuple, Generic[Number]):
    """What guidance wants: course with its rate and speed over ground, depth (m) and sink rate (m/s)."""

    course: Course[Number]
    depth: Number
    sink: Number


Steer: TypeAlias = Callable[[Sequence[Number], Motion[Number], Wanted[Number]], list[Number]]
"""The rates of actuators and controllers from their state, the motion and what is wanted."""


def servo(
    limit: float, greatest_rate: float, time_constant_s: float, maths: Maths[Number]
) -> Callable[[Number, Number], Number]:
    """Build the rate of an actuator from its command and its state: fin (rad), shaft (rev/s) or thrust (N).

    The command is clipped, then lagged, then rate-limited.
    """
    clip, corner = maths.clip, 1.0 / time_constant_s

    def motion(command: Number, state: Number) -> Number:
        return clip(corner * (clip(command, -limit, limit) - state), -greatest_rate, greatest_rate)

    return motion


def pid(
    gains: AttitudePid | SpeedPid | VelocityPi | AnglePid, low: float, high: float, maths: Maths[Number]
) -> Callable[..., tuple[Number, Number]]:
    """Build one controller with its limits: (error, its derivative, its integral) -> (command, the integral's rate).

    Optional are the scale of the command and a feed-forward. Anti-windup by back-calculation: the excess over the limit
    drives the integrator back over the tracking time (Åström and Hägglund 2006).
    """
    proportional, integral_gain = gains.proportional, gains.integral
    derivative = 0.0 if isinstance(gains, VelocityPi) else gains.derivative
    bleed, clip = 1.0 / (gains.tracking_time * gains.integral), maths.clip

    def control(
        error: Number,
        rate: Number,
        integral: Number,
        scale: Number | float = 1.0,
        forward: Number | float = 0.0,
    ) -> tuple[Number, Number]:
        wanted = (forward + proportional * error + integral_gain * integral + derivative * rate) * scale
        given = clip(wanted, low, high)
        return given, error + bleed * (given - wanted) / scale

    return control


def fin_mixing(vehicle: Vehicle) -> FloatArray:
    """Fin deflections of unit equivalent roll, pitch and yaw deflections, (4, 3).

    A deflection d_i of the fin at azimuth a_i acts as d_i in roll, d_i cos a_i in pitch and d_i sin a_i in yaw (see
    `equations`), so that the command for fin i is roll + cos a_i pitch + sin a_i yaw. For a regular cross, + or x, the
    three columns are orthogonal.
    """
    return np.array([(1.0, math.cos(azimuth), math.sin(azimuth)) for azimuth in vehicle.fins.azimuth])


def fin_steering(vehicle: Vehicle, maths: Maths[Number], stuck: StuckFin | None) -> Steer[Number]:
    """Build the rates of fins, shaft, autopilot and guidance, in the layout of `model`.

    The gains of the fins hold at cruise speed; their forces grow with the speed squared. A stuck fin is held at its
    angle by a fast lag.
    """
    pilot, limits, fin, prop = vehicle.autopilot, vehicle.limits, vehicle.fin_actuator, vehicle.propeller
    roll_pid, pitch_pid, yaw_pid = (
        pid(gains, -gains.limit, gains.limit, maths) for gains in (pilot.roll, pilot.pitch, pilot.yaw)
    )
    speed_pid, forward = pid(pilot.speed, 0.0, prop.max_speed, maths), pilot.speed.feed_forward
    roll_corner, pitch_corner, yaw_corner, speed_corner = (
        1.0 / gains.derivative_filter for gains in (pilot.roll, pilot.pitch, pilot.yaw, pilot.speed)
    )
    fin_servo = servo(fin.max_deflection, fin.max_rate, fin.time_constant, maths)
    motor = servo(prop.max_speed, prop.max_acceleration, prop.time_constant, maths)
    mixing = [(float(c), float(s)) for _, c, s in fin_mixing(vehicle)]
    depth_law, crab_corner = depth_by_pitch(vehicle, maths), 1.0 / vehicle.guidance.crab_time_constant
    cruise, slowest, fastest = limits.cruise_speed, limits.min_speed, limits.max_speed
    clip, atan2, wrap = maths.clip, maths.atan2, maths.wrap

    def steer(own: Sequence[Number], motion: Motion[Number], wanted: Wanted[Number]) -> list[Number]:
        fins, shaft, (roll_i, roll_f, pitch_i, pitch_f, yaw_i, yaw_f) = own[:4], own[4], own[5:11]
        speed_i, speed_f, crab, depth_i = own[11:]
        p, q, r = motion.rates
        (course, course_rate, speed), depth, sink = wanted
        pitch, depth_rate = depth_law(depth, sink, motion.depth, motion.speed, depth_i)
        scheduled = clip(motion.ahead, slowest, fastest)
        scale = cruise * cruise / (scheduled * scheduled)
        roll_fin, roll_rate = roll_pid(-motion.roll, roll_f, roll_i, scale)
        pitch_fin, pitch_rate = pitch_pid(pitch - motion.pitch, pitch_f, pitch_i, scale)
        yaw_fin, yaw_rate = yaw_pid(wrap(course - crab - motion.yaw), yaw_f, yaw_i, scale)
        revolutions, speed_rate = speed_pid(speed - motion.speed, speed_f, speed_i, 1.0, forward * speed)
        fin_rates: list[Number] = [
            fin_servo(roll_fin + c * pitch_fin + s * yaw_fin, angle)
            for (c, s), angle in zip(mixing, fins, strict=True)
        ]
        if stuck is not None:
            fin_rates[stuck.fin - 1] = 50.0 * (stuck.angle_rad - fins[stuck.fin - 1])
        return fin_rates + [  # noqa: RUF005 - mypy cannot type an unpacked list of Number
            motor(revolutions, shaft),
            roll_rate, roll_corner * (-p - roll_f), pitch_rate, pitch_corner * (-q - pitch_f),
            yaw_rate, yaw_corner * (course_rate - r - yaw_f),
            speed_rate, speed_corner * (-motion.surge_rate - speed_f),
            crab_corner * (atan2(motion.starboard, motion.ahead) - crab), depth_rate,
        ]  # fmt: skip

    return steer


def thruster_steering(
    vehicle: HoveringVehicle, maths: Maths[Number], heading_rad: float | None
) -> Steer[Number]:
    """Build the rates of thrusts and integrals; without a heading the vehicle points along its path.

    The velocity along the course is controlled ahead and to starboard; depth by heave; roll and pitch to level. The six
    forces and moments are allocated to the thrusters by least squares (Fossen 2011, section 12.3).
    """
    drives = vehicle.thrusters
    laws: list[Callable[..., tuple[Number, Number]]] = [
        pid(gains, -gains.limit, gains.limit, maths) for gains in vehicle.autopilot.axes()
    ]
    allocation = np.linalg.pinv(drives.wrenches()).tolist()
    count, push = len(allocation), servo(drives.max_thrust, math.inf, drives.time_constant, maths)
    depth_gain = vehicle.guidance.depth_gain
    sin, cos, wrap = maths.sin, maths.cos, maths.wrap

    def steer(own: Sequence[Number], motion: Motion[Number], wanted: Wanted[Number]) -> list[Number]:
        thrusts, integrals = own[:count], own[count:]
        p, q, r = motion.rates
        course, course_rate, speed = wanted.course
        off_course = course - motion.yaw
        ahead = speed * cos(off_course) - motion.ahead
        beside = speed * sin(off_course) - motion.starboard
        heave = wanted.sink + depth_gain * (wanted.depth - motion.depth) - motion.sink
        if heading_rad is None:
            turn, turn_rate = wrap(off_course), course_rate - r
        else:
            turn, turn_rate = wrap(heading_rad - motion.yaw), -r
        errors = (ahead, beside, heave, -motion.roll, -motion.pitch, turn)
        zero = 0.0 * ahead
        error_rates = (zero, zero, zero, -p, -q, turn_rate)
        given: list[tuple[Number, Number]] = [
            law(error, rate, integral)
            for law, error, rate, integral in zip(laws, errors, error_rates, integrals, strict=True)
        ]
        commands: list[Number] = [
            sum(k * force for k, (force, _) in zip(row, given, strict=True)) for row in allocation
        ]
        rates: list[Number] = [
            push(command, thrust) for command, thrust in zip(commands, thrusts, strict=True)
        ]
        return rates + [rate for _, rate in given]

    return steer
