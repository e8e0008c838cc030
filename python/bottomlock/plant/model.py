"""The vehicle as one system of equations: body, actuators, autopilot and guidance.

State: position_t 0:3, attitude_t_p 3:7, nu 7:13, then actuators and controllers. With fins (28 in all): fins 13:17,
shaft 17, the autopilot's memory: roll 18:20, pitch 20:22, yaw 22:24, speed 24:26 (each integral, filtered rate error),
crab angle 26, depth integral 27. With thrusters: thrust of each (N), then the integrals of the surge, sway and heave
controllers (m) and of roll, pitch and yaw (rad s).
"""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import TypeAlias

import numpy as np

from bottomlock.plant.control import (
    Motion,
    Segment,
    Wanted,
    constant_bearing,
    fin_steering,
    line_of_sight,
    thruster_steering,
)
from bottomlock.plant.equations import acceleration, to_platform, to_tangent
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import ARRAY, FloatArray, Four, Maths, Number, Three
from bottomlock.plant.mission import Mission
from bottomlock.plant.vehicle import Vehicle

ATTITUDE = slice(3, 7)
NU = slice(7, 13)
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


def motion_estimate(maths: Maths[Number]) -> Callable[..., Motion[Number]]:
    """Build the estimated motion that control uses: the true motion less the navigation error.

    The function takes the attitude quaternion, the velocity (tangent frame, m/s), the depth (m), the body rates
    (rad/s), the acceleration ahead (m/s²) and the navigation error.
    """
    sqrt, sin, cos, asin, atan2 = maths.sqrt, maths.sin, maths.cos, maths.asin, maths.atan2
    clip = maths.clip

    def estimate(
        attitude: Four[Number],
        velocity: Three[Number],
        depth: Number,
        rates: Three[Number],
        surge_rate: Number,
        error: Error[Number],
    ) -> Motion[Number]:
        q0, q1, q2, q3 = attitude
        _, _, e_depth, e_vn, e_ve, e_vd, e_roll, e_pitch, e_yaw = error
        roll = atan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2)) - e_roll
        pitch = asin(clip(2.0 * (q0 * q2 - q1 * q3), -1.0, 1.0)) - e_pitch
        yaw = atan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3)) - e_yaw
        north, east, sink = velocity[0] - e_vn, velocity[1] - e_ve, velocity[2] - e_vd
        cos_yaw, sin_yaw = cos(yaw), sin(yaw)
        ahead = cos_yaw * north + sin_yaw * east
        starboard = cos_yaw * east - sin_yaw * north
        speed = sqrt(ahead * ahead + starboard * starboard + sink * sink)
        return Motion(roll, pitch, yaw, ahead, starboard, speed, depth - e_depth, sink, rates, surge_rate)

    return estimate


def _current(row: Row[Number], depth: Number, sink: Number) -> tuple[Three[Number], Three[Number]]:
    """Velocity of the current at a depth, and its acceleration along the path of a vehicle that sinks (tangent)."""
    zero, rate = 0.0 * depth, 0.0 * sink
    return (
        (row[0] + row[4] * depth, row[1] + row[5] * depth, zero),
        (row[2] + row[4] * sink, row[3] + row[5] * sink, rate),
    )


def derivative(
    vehicle: AnyVehicle, mission: Mission, maths: Maths[Number], gravity_mps2: float
) -> Derivative[Number]:
    """Build x' as a function of the state, the timetable's row, the path segment and the navigation error.

    The navigation error is true minus estimated: position_t m, velocity_t m/s, roll, pitch, yaw rad. Guidance and
    control use the estimate; with zeros they use the truth. A heading is held by a vehicle with thrusters alone.
    """
    nu_dot, estimate = acceleration(vehicle, gravity_mps2, maths), motion_estimate(maths)
    if isinstance(vehicle, Vehicle):
        steer = fin_steering(vehicle, maths, mission.stuck)
    else:
        steer = thruster_steering(vehicle, maths, mission.heading_rad)
    if mission.law == "line_of_sight":
        guide = line_of_sight(vehicle, mission.speed_mps, maths)
    else:
        guide = constant_bearing(vehicle, maths)

    def rates(
        state: Sequence[Number], row: Row[Number], segment: Segment[Number], error: Error[Number]
    ) -> list[Number]:
        north, east, depth, q0, q1, q2, q3, u, v, w, p, q, r = state[:OWN]
        own, attitude, turning = state[OWN:], (q0, q1, q2, q3), (p, q, r)
        velocity = to_tangent(q0, q1, q2, q3, u, v, w)
        turn = (
            -0.5 * (q1 * p + q2 * q + q3 * r), 0.5 * (q0 * p + q2 * r - q3 * q),
            0.5 * (q0 * q + q3 * p - q1 * r), 0.5 * (q0 * r + q1 * q - q2 * p),
        )  # fmt: skip
        nu_rates = nu_dot(attitude, (u, v, w, p, q, r), own, *_current(row, depth, velocity[2]))
        motion = estimate(attitude, velocity, depth, turning, nu_rates[0], error)
        course = guide(north - error[0], east - error[1], segment, row[8:])
        controls = steer(own, motion, Wanted(course, row[6], row[7]))
        return list(chain(velocity, turn, nu_rates, controls))

    return rates


def motion_through_water(
    vehicle: AnyVehicle, gravity_mps2: float
) -> Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Build nu' (n, 6), m/s² and rad/s², and the velocity relative to the water (n, 3), platform frame, m/s.

    Of states (n, size) at the rows (n, 13) of the timetable.
    """
    nu_dot = acceleration(vehicle, gravity_mps2, ARRAY)

    def along(states: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        _, _, depth, q0, q1, q2, q3, u, v, w, p, q, r, *own = states.T
        _, _, sink = to_tangent(q0, q1, q2, q3, u, v, w)
        current, current_rate = _current(list(rows.T), depth, sink)
        rates = nu_dot((q0, q1, q2, q3), (u, v, w, p, q, r), own, current, current_rate)
        through = states[:, NU][:, :3] - np.stack(to_platform(q0, q1, q2, q3, *current), axis=1)
        return np.stack(rates, axis=1), through

    return along
