"""From what guidance wants and the navigation estimates to the rates of actuators and controllers."""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Generic, NamedTuple, TypeAlias

from bottomlock.plant.actuators import StuckFin, actuator_rates
from bottomlock.plant.autopilot import autopilot
from bottomlock.plant.guidance import depth_by_pitch
from bottomlock.plant.maths import Maths, Number
from bottomlock.plant.vehicle import Vehicle


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
