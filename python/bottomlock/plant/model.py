"""The vehicle as one system of equations: body, actuators, autopilot and guidance.

State (28): position_t 0:3, attitude_t_p 3:7, nu 7:13, fins 13:17, shaft 17, then the autopilot's memory: roll 18:20,
pitch 20:22, yaw 22:24, speed 24:26 (each integral, filtered rate error), crab angle 26, depth integral 27.
"""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import TypeAlias

from bottomlock.plant.actuators import StuckFin, actuator_rates
from bottomlock.plant.autopilot import autopilot
from bottomlock.plant.equations import Four, Six, Three, acceleration, to_platform, to_tangent
from bottomlock.plant.guidance import Law, Segment, constant_bearing, depth_by_pitch, line_of_sight
from bottomlock.plant.maths import Maths, Number
from bottomlock.plant.vehicle import Vehicle

POSITION = slice(0, 3)
ATTITUDE = slice(3, 7)
NU = slice(7, 13)
FINS = slice(13, 17)
SHAFT = 17
ROLL_PID, PITCH_PID, YAW_PID, SPEED_PID = 18, 20, 22, 24
CRAB = 26
DEPTH_INTEGRAL = 27
SIZE = 28

FIELDS = 13
"""Inputs known before the run, per time (`Mission.timetable`): current (N, E), its rate of change (N, E), shear (N, E
per metre), wanted depth, wanted sink rate, target (N, E, velocity N, velocity E, course rate)."""

Row: TypeAlias = Sequence[Number]
Error: TypeAlias = tuple[Number, Number, Number, Number, Number, Number, Number, Number, Number]
State: TypeAlias = Sequence[Number]
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


def derivative(
    vehicle: Vehicle,
    maths: Maths[Number],
    *,
    speed_mps: float,
    law: Law,
    gravity_mps2: float,
    stuck: StuckFin | None = None,
) -> Derivative[Number]:
    """Build x' as a function of the state, the timetable's row, the path segment and the navigation error.

    The navigation error is true minus estimated: position_t m, velocity_t m/s, roll, pitch, yaw rad. Guidance and
    control use the estimate; with zeros they use the truth.
    """
    nu_dot = acceleration(vehicle, gravity_mps2, maths)
    estimate, control = estimated_motion(maths), autopilot(vehicle, maths)
    actuators = actuator_rates(vehicle, maths, stuck)
    guide = (
        line_of_sight(vehicle, speed_mps, maths)
        if law == "line_of_sight"
        else constant_bearing(vehicle, maths)
    )
    depth_law = depth_by_pitch(vehicle, maths)
    crab_corner = 1.0 / vehicle.guidance.crab_time_constant
    atan2, wrap = maths.atan2, maths.wrap

    def rates(
        state: Sequence[Number], row: Row[Number], segment: Segment[Number], error: Error[Number]
    ) -> list[Number]:
        north, east, depth, q0, q1, q2, q3, u, v, w, p, q, r, fin1, fin2, fin3, fin4, shaft = state[:ROLL_PID]
        memory, crab, depth_i = state[ROLL_PID:CRAB], state[CRAB], state[DEPTH_INTEGRAL]
        c_n, c_e, a_n, a_e, s_n, s_e, depth_wanted, sink_wanted, t_n, t_e, t_vn, t_ve, t_rate = row
        target = (t_n, t_e, t_vn, t_ve, t_rate)
        attitude, fins = (q0, q1, q2, q3), (fin1, fin2, fin3, fin4)
        velocity_n = to_tangent(q0, q1, q2, q3, u, v, w)
        v_d = velocity_n[2]
        zero = 0.0 * u
        current_velocity_n = (c_n + s_n * depth, c_e + s_e * depth, zero)
        current_accel_n = (a_n + s_n * v_d, a_e + s_e * v_d, zero)
        nu_rates = nu_dot(attitude, (u, v, w, p, q, r), fins, shaft, current_velocity_n, current_accel_n)
        roll, pitch, yaw, ahead, starboard, speed = estimate(attitude, velocity_n, error)
        course, rate_wanted, speed_wanted = guide(north - error[0], east - error[1], segment, target)
        pitch_wanted, depth_i_dot = depth_law(depth_wanted, sink_wanted, depth - error[2], speed, depth_i)
        fin_commands, shaft_command, memory_dot = control(
            (-roll, pitch_wanted - pitch, wrap(course - crab - yaw)),
            (-p, -q, rate_wanted - r),
            (speed_wanted, speed_wanted - speed, -nu_rates[0]),
            ahead,
            memory,
        )
        fin_rates, shaft_rate = actuators(fin_commands, fins, shaft_command, shaft)
        crab_dot = crab_corner * (atan2(starboard, ahead) - crab)
        attitude_rate = quaternion_rate(attitude, p, q, r)
        guidance_dot = (crab_dot, depth_i_dot)
        return list(
            chain(velocity_n, attitude_rate, nu_rates, fin_rates, (shaft_rate,), memory_dot, guidance_dot)
        )

    return rates


def velocity_through_water_p(state: Sequence[Number], row: Sequence[Number]) -> tuple[Number, Number, Number]:
    """Velocity relative to the water, platform frame, m/s, from a state and its timetable row."""
    depth = state[2]
    q0, q1, q2, q3, u, v, w = (state[index] for index in range(3, 10))
    c_n, c_e, s_n, s_e = row[0], row[1], row[4], row[5]
    uc, vc, wc = to_platform(q0, q1, q2, q3, c_n + s_n * depth, c_e + s_e * depth, 0.0 * u)
    return u - uc, v - vc, w - wc
