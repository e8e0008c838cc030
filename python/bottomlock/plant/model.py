"""The vehicle as one system of equations: body, actuators, autopilot and guidance.

State: position_t 0:3, attitude_t_p 3:7, nu 7:13, then actuators and controllers. With fins (28 in all): fins 13:17,
shaft 17, the autopilot's memory: roll 18:20, pitch 20:22, yaw 22:24, speed 24:26 (each integral, filtered rate error),
crab angle 26, depth integral 27. With thrusters: thrust of each (N), then
the integrals of the surge, sway and heave controllers (m) and of roll, pitch and yaw (rad s).
"""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import TypeAlias

import numpy as np

from bottomlock.plant.autopilot import Motion, Steer, Wanted, fin_steering
from bottomlock.plant.equations import Four, Six, Three, acceleration, to_platform, to_tangent
from bottomlock.plant.guidance import Segment, constant_bearing, line_of_sight
from bottomlock.plant.hovering_vehicle import AnglePid, AnyVehicle, HoveringVehicle, VelocityPi
from bottomlock.plant.maths import ARRAY, FloatArray, Maths, Number
from bottomlock.plant.mission import Mission
from bottomlock.plant.vehicle import Vehicle


def _controller(
    gains: VelocityPi | AnglePid, maths: Maths[Number]
) -> Callable[[Number, Number, Number], tuple[Number, Number]]:
    """Build (error, its rate, integral) -> (force or moment, the integral's rate); anti-windup as for the fins."""
    proportional, integral_gain, limit = gains.proportional, gains.integral, gains.limit
    derivative = gains.derivative if isinstance(gains, AnglePid) else 0.0
    bleed, clip = 1.0 / (gains.tracking_time * gains.integral), maths.clip

    def control(error: Number, rate: Number, integral: Number) -> tuple[Number, Number]:
        wanted = proportional * error + derivative * rate + integral_gain * integral
        given = clip(wanted, -limit, limit)
        return given, error + bleed * (given - wanted)

    return control


def thruster_steering(
    vehicle: HoveringVehicle, maths: Maths[Number], heading_rad: float | None
) -> Steer[Number]:
    """Build the rates of thrusts and integrals; without a heading the vehicle points along its path.

    The velocity along the course is controlled ahead and to starboard; depth by heave; roll and pitch to level. The six
    forces and moments are allocated to the thrusters by least squares (Fossen 2011, section 12.3).
    """
    drives = vehicle.thrusters
    laws: list[Callable[[Number, Number, Number], tuple[Number, Number]]] = [
        _controller(gains, maths) for gains in vehicle.autopilot.axes()
    ]
    allocation = np.linalg.pinv(drives.wrenches()).tolist()
    count, greatest, corner = len(allocation), drives.max_thrust, 1.0 / drives.time_constant
    depth_gain = vehicle.guidance.depth_gain
    sin, cos, clip, wrap = maths.sin, maths.cos, maths.clip, maths.wrap

    def steer(own: Sequence[Number], motion: Motion[Number], wanted: Wanted[Number]) -> list[Number]:
        thrusts, integrals = own[:count], own[count:]
        p, q, r = motion.rates
        off_course = wanted.course - motion.yaw
        ahead = wanted.speed * cos(off_course) - motion.ahead
        beside = wanted.speed * sin(off_course) - motion.starboard
        heave = wanted.sink + depth_gain * (wanted.depth - motion.depth) - motion.sink
        if heading_rad is None:
            turn, turn_rate = wrap(off_course), wanted.course_rate - r
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
        thrust_rates: list[Number] = [
            corner * (clip(command, -greatest, greatest) - thrust)
            for command, thrust in zip(commands, thrusts, strict=True)
        ]
        return thrust_rates + [rate for _, rate in given]

    return steer


ATTITUDE = slice(3, 7)
NU = slice(7, 13)
FINS = slice(13, 17)
OWN = 13
"""Where the state of actuators and controllers begins."""

FIELDS = 13
"""Inputs known before the run, per time (`Mission.timetable`): current (N, E), its rate of change (N, E), shear (N, E
per metre), wanted depth, wanted sink rate, target (N, E, velocity N, velocity E, course rate)."""

Row: TypeAlias = Sequence[Number]
Error: TypeAlias = tuple[Number, Number, Number, Number, Number, Number, Number, Number, Number]
Derivative: TypeAlias = Callable[
    [Sequence[Number], Row[Number], Segment[Number], Error[Number]], list[Number]
]


def estimated_motion(
    maths: Maths[Number],
) -> Callable[[Four[Number], Three[Number], Error[Number]], Six[Number]]:
    """Build the estimated motion that control uses: the true motion less the navigation error.

    The function takes the attitude quaternion, the velocity (tangent frame, m/s) and the navigation error, and returns
    roll, pitch, yaw (rad), the speeds ahead and to starboard in the level heading frame, and the speed (m/s).
    """
    sqrt, sin, cos, asin, atan2 = maths.sqrt, maths.sin, maths.cos, maths.asin, maths.atan2
    clip = maths.clip

    def estimate(attitude: Four[Number], velocity: Three[Number], error: Error[Number]) -> Six[Number]:
        q0, q1, q2, q3 = attitude
        v_n, v_e, v_d = velocity
        _, _, _, e_vn, e_ve, e_vd, e_roll, e_pitch, e_yaw = error
        roll = atan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2)) - e_roll
        pitch = asin(clip(2.0 * (q0 * q2 - q1 * q3), -1.0, 1.0)) - e_pitch
        yaw = atan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3)) - e_yaw
        north, east = v_n - e_vn, v_e - e_ve
        cos_yaw, sin_yaw = cos(yaw), sin(yaw)
        ahead = cos_yaw * north + sin_yaw * east
        starboard = cos_yaw * east - sin_yaw * north
        speed = sqrt(ahead * ahead + starboard * starboard + (v_d - e_vd) * (v_d - e_vd))
        return roll, pitch, yaw, ahead, starboard, speed

    return estimate


def quaternion_rate(attitude: Four[Number], p: Number, q: Number, r: Number) -> Four[Number]:
    """Time derivative of the quaternion (scalar first) at the body rates p, q, r (rad/s)."""
    q0, q1, q2, q3 = attitude
    return (
        -0.5 * (q1 * p + q2 * q + q3 * r),
        0.5 * (q0 * p + q2 * r - q3 * q),
        0.5 * (q0 * q + q3 * p - q1 * r),
        0.5 * (q0 * r + q1 * q - q2 * p),
    )


def _current(row: Row[Number], depth: Number) -> Three[Number]:
    """Velocity of the current at a depth, tangent frame."""
    return row[0] + row[4] * depth, row[1] + row[5] * depth, 0.0 * depth


def _current_rate(row: Row[Number], sink: Number) -> Three[Number]:
    """Acceleration of the current along the path of a vehicle that sinks, tangent frame."""
    return row[2] + row[4] * sink, row[3] + row[5] * sink, 0.0 * sink


def derivative(
    vehicle: AnyVehicle, mission: Mission, maths: Maths[Number], gravity_mps2: float
) -> Derivative[Number]:
    """Build x' as a function of the state, the timetable's row, the path segment and the navigation error.

    The navigation error is true minus estimated: position_t m, velocity_t m/s, roll, pitch, yaw rad. Guidance and
    control use the estimate; with zeros they use the truth. A heading is held by a vehicle with thrusters alone.
    """
    nu_dot = acceleration(vehicle, gravity_mps2, maths)
    estimate = estimated_motion(maths)
    steer: Steer[Number] = (
        fin_steering(vehicle, maths, mission.stuck)
        if isinstance(vehicle, Vehicle)
        else thruster_steering(vehicle, maths, mission.heading_rad)
    )
    guide = (
        line_of_sight(vehicle, mission.speed_mps, maths)
        if mission.law == "line_of_sight"
        else constant_bearing(vehicle, maths)
    )

    def rates(
        state: Sequence[Number], row: Row[Number], segment: Segment[Number], error: Error[Number]
    ) -> list[Number]:
        north, east, depth, q0, q1, q2, q3, u, v, w, p, q, r = state[:OWN]
        own = state[OWN:]
        depth_wanted, sink_wanted, t_n, t_e, t_vn, t_ve, t_rate = row[6:]
        target = (t_n, t_e, t_vn, t_ve, t_rate)
        attitude = (q0, q1, q2, q3)
        velocity_n = to_tangent(q0, q1, q2, q3, u, v, w)
        v_d = velocity_n[2]
        nu_rates = nu_dot(attitude, (u, v, w, p, q, r), own, _current(row, depth), _current_rate(row, v_d))
        motion = Motion(
            *estimate(attitude, velocity_n, error), depth - error[2], v_d - error[5], (p, q, r), nu_rates[0]
        )
        course, rate_wanted, speed_wanted = guide(north - error[0], east - error[1], segment, target)
        wanted = Wanted(course, rate_wanted, speed_wanted, depth_wanted, sink_wanted)
        attitude_rate = quaternion_rate(attitude, p, q, r)
        return list(chain(velocity_n, attitude_rate, nu_rates, steer(own, motion, wanted)))

    return rates


def accelerations(vehicle: AnyVehicle, gravity_mps2: float) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Build nu' (n, 6), m/s² and rad/s², of states (n, size) at the rows (n, 13) of the timetable."""
    nu_dot = acceleration(vehicle, gravity_mps2, ARRAY)

    def along(states: FloatArray, rows: FloatArray) -> FloatArray:
        _, _, depth, q0, q1, q2, q3, u, v, w, p, q, r, *own = states.T
        _, _, sink = to_tangent(q0, q1, q2, q3, u, v, w)
        current = _current(list(rows.T), depth), _current_rate(list(rows.T), sink)
        return np.stack(nu_dot((q0, q1, q2, q3), (u, v, w, p, q, r), own, *current), axis=1)

    return along


def velocity_through_water_p(states: FloatArray, rows: FloatArray) -> FloatArray:
    """Velocity relative to the water (n, 3), platform frame, m/s, of states at the rows of the timetable."""
    _, _, depth, q0, q1, q2, q3 = states.T[:7]
    current_p = to_platform(q0, q1, q2, q3, *_current(list(rows.T), depth))
    return np.asarray(states[:, NU][:, :3] - np.stack(current_p, axis=1))
