"""Controllers and actuators of a vehicle that thrusters move in every direction.

Its part of the state, after the 13 of the body: thrust of each thruster (N), then the integrals of the surge, sway and
heave controllers (m) and of roll, pitch and yaw (rad s). The vehicle holds a heading and crabs along its path.
"""

from collections.abc import Callable, Sequence

import numpy as np

from bottomlock.plant.hovering_vehicle import AnglePid, HoveringVehicle, VelocityPi
from bottomlock.plant.maths import Maths, Number
from bottomlock.plant.steering import Motion, Steer, Wanted


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
