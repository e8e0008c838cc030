"""Guidance: wanted course, speed and pitch from the estimated position.

Two laws for the horizontal plane: line of sight with look-ahead along the path, and constant bearing to a target that
moves along it (Breivik and Fossen 2009). In the vertical plane a depth profile is followed by pitch.
"""

from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias

from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import Maths, Number
from bottomlock.plant.vehicle import Vehicle

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
