"""The vehicle under way: body, actuators, autopilot and guidance as one system of equations.

State (28): position_t 0:3, attitude_t_p 3:7, nu 7:13, fins 13:17, shaft 17, then the autopilot's memory:
roll 18:20, pitch 20:22, yaw 22:24, speed 24:26 (each integral, filtered rate error), crab angle 26, depth
integral 27.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from bottomlock.plant.actuators import StuckFin, fin_servo, thruster
from bottomlock.plant.autopilot import attitude_pid, fin_commands, speed_pid
from bottomlock.plant.equations import Four, acceleration, to_platform, to_tangent
from bottomlock.plant.guidance import Law, Segment, constant_bearing, depth_by_pitch, line_of_sight
from bottomlock.plant.lanes import Lane, Maths
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
"""Inputs known before the run, per time: current (N, E), its own rate of change (N, E), shear (N, E per
metre), depth wanted, sink rate wanted, target (N, E, velocity N, velocity E, turn rate); see
`timetable`."""

Row: TypeAlias = Sequence[Lane]
Error: TypeAlias = tuple[Lane, Lane, Lane, Lane, Lane, Lane, Lane, Lane, Lane]
State: TypeAlias = Sequence[Lane]
Derivative: TypeAlias = Callable[[Sequence[Lane], Row[Lane], Segment[Lane], Error[Lane]], list[Lane]]


def derivative(
    vehicle: Vehicle,
    maths: Maths[Lane],
    *,
    speed_mps: float,
    law: Law,
    gravity_mps2: float,
    stuck: StuckFin | None = None,
) -> Derivative[Lane]:
    """Build x' as a function of the state, the timetable's row, the path segment and the navigation error.

    The navigation error (true minus believed: position_t m, velocity_t m/s, roll, pitch, yaw rad) is what
    guidance and control are fooled by; zeros fly on the truth.
    """
    nu_dot = acceleration(vehicle, gravity_mps2, maths)
    servo, motor = fin_servo(vehicle, maths), thruster(vehicle, maths)
    pilot = vehicle.autopilot
    roll_pid, pitch_pid, yaw_pid = (
        attitude_pid(gains, maths) for gains in (pilot.roll, pilot.pitch, pilot.yaw)
    )
    speed_law = speed_pid(pilot.speed, vehicle.propeller.max_speed, maths)
    mix: Callable[[Lane, Lane, Lane], Four[Lane]] = fin_commands(vehicle)
    steer = (
        line_of_sight(vehicle, speed_mps, maths)
        if law == "line_of_sight"
        else constant_bearing(vehicle, maths)
    )
    dive = depth_by_pitch(vehicle, maths)
    limits = vehicle.limits
    cruise, slowest, fastest = limits.cruise_speed, limits.min_speed, limits.max_speed
    crab_corner = 1.0 / vehicle.guidance.crab_time_constant
    sqrt, sin, cos, asin, atan2 = maths.sqrt, maths.sin, maths.cos, maths.asin, maths.atan2
    clip, wrap = maths.clip, maths.wrap
    jammed = stuck.fin - 1 if stuck is not None else -1
    jam = stuck.angle_rad if stuck is not None else 0.0

    def rates(
        state: Sequence[Lane], row: Row[Lane], segment: Segment[Lane], error: Error[Lane]
    ) -> list[Lane]:
        (
            north, east, depth, q0, q1, q2, q3, u, v, w, p, q, r, fin1, fin2, fin3, fin4, shaft,
            roll_i, roll_f, pitch_i, pitch_f, yaw_i, yaw_f, speed_i, speed_f, crab, depth_i,
        ) = state  # fmt: skip
        c_n, c_e, a_n, a_e, s_n, s_e, depth_wanted, sink_wanted, t_n, t_e, t_vn, t_ve, t_rate = row
        v_n, v_e, v_d = to_tangent(q0, q1, q2, q3, u, v, w)
        zero = 0.0 * u
        # mechanics
        water = (c_n + s_n * depth, c_e + s_e * depth, zero)
        swell = (a_n + s_n * v_d, a_e + s_e * v_d, zero)
        ud, vd, wd, pd, qd, rd = nu_dot(
            (q0, q1, q2, q3), (u, v, w, p, q, r), (fin1, fin2, fin3, fin4), shaft, water, swell
        )
        # what the vehicle believes
        e_n, e_e, e_d, e_vn, e_ve, e_vd, e_roll, e_pitch, e_yaw = error
        roll = atan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2)) - e_roll
        pitch = asin(clip(2.0 * (q0 * q2 - q1 * q3), -1.0, 1.0)) - e_pitch
        yaw = atan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3)) - e_yaw
        b_vn, b_ve = v_n - e_vn, v_e - e_ve
        cos_yaw, sin_yaw = cos(yaw), sin(yaw)
        ahead = cos_yaw * b_vn + sin_yaw * b_ve
        aside = cos_yaw * b_ve - sin_yaw * b_vn
        pace = sqrt(ahead * ahead + aside * aside + (v_d - e_vd) * (v_d - e_vd))
        # guidance
        course, rate_wanted, speed_wanted = steer(
            north - e_n, east - e_e, segment, (t_n, t_e, t_vn, t_ve, t_rate)
        )
        pitch_wanted, depth_i_dot = dive(depth_wanted, sink_wanted, depth - e_d, pace, depth_i)
        # control; the gains serve cruise speed, fin forces grow with speed squared
        gauge = clip(ahead, slowest, fastest)
        scale = cruise * cruise / (gauge * gauge)
        roll_fin, roll_i_dot, roll_f_dot = roll_pid(-roll, -p, roll_i, roll_f, scale)
        pitch_fin, pitch_i_dot, pitch_f_dot = pitch_pid(pitch_wanted - pitch, -q, pitch_i, pitch_f, scale)
        heading_error = wrap(course - crab - yaw)
        yaw_fin, yaw_i_dot, yaw_f_dot = yaw_pid(heading_error, rate_wanted - r, yaw_i, yaw_f, scale)
        command, speed_i_dot, speed_f_dot = speed_law(
            speed_wanted, speed_wanted - pace, -ud, speed_i, speed_f
        )
        # actuators
        angles = (fin1, fin2, fin3, fin4)
        fin_rates: list[Lane] = [
            servo(wanted, angle)
            for wanted, angle in zip(mix(roll_fin, pitch_fin, yaw_fin), angles, strict=True)
        ]
        if jammed >= 0:
            fin_rates[jammed] = 50.0 * (jam - angles[jammed])
        return [
            v_n,
            v_e,
            v_d,
            -0.5 * (q1 * p + q2 * q + q3 * r),
            0.5 * (q0 * p + q2 * r - q3 * q),
            0.5 * (q0 * q + q3 * p - q1 * r),
            0.5 * (q0 * r + q1 * q - q2 * p),
            ud,
            vd,
            wd,
            pd,
            qd,
            rd,
            fin_rates[0],
            fin_rates[1],
            fin_rates[2],
            fin_rates[3],
            motor(command, shaft),
            roll_i_dot,
            roll_f_dot,
            pitch_i_dot,
            pitch_f_dot,
            yaw_i_dot,
            yaw_f_dot,
            speed_i_dot,
            speed_f_dot,
            crab_corner * (atan2(aside, ahead) - crab),
            depth_i_dot,
        ]

    return rates


def water_velocity_p(state: Sequence[Lane], row: Sequence[Lane]) -> tuple[Lane, Lane, Lane]:
    """Velocity relative to the water, platform frame, m/s, from a state and its timetable row."""
    depth = state[2]
    q0, q1, q2, q3, u, v, w = (state[index] for index in range(3, 10))
    c_n, c_e, s_n, s_e = row[0], row[1], row[4], row[5]
    uc, vc, wc = to_platform(q0, q1, q2, q3, c_n + s_n * depth, c_e + s_e * depth, 0.0 * u)
    return u - uc, v - vc, w - wc
