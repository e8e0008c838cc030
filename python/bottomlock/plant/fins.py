"""Lift and drag of the tail fins, with inflow angle and stall.

Fin i stands at r_i = (x, R cos a, R sin a), a from starboard towards down; its normal is n_i = (0, -sin a,
cos a). A positive deflection turns the leading edge towards n_i and pushes the fin along n_i, so equal
deflections roll the vehicle to starboard.
"""

import math
from collections.abc import Callable

from bottomlock.plant.hull import Wrench
from bottomlock.plant.maths import Maths, Number
from bottomlock.plant.vehicle import Vehicle


def lift_and_drag(vehicle: Vehicle, maths: Maths[Number]) -> Callable[[Number], tuple[Number, Number]]:
    """Build C_L and C_D of one fin as functions of its angle of attack, rad.

    Below stall the lift is linear and the drag the usual polar; past it the fin is a flat plate (C_L = 2
    |sin a| sin a cos a, C_D = 2 sin² a). The two blend smoothly over the stall width: Beard and McLain 2012
    as in MSS coeffLiftDrag.m, here with the plate's drag and a tanh for the blend.
    """
    fins = vehicle.fins
    slope, base, stall = fins.lift_slope, fins.zero_lift_drag, fins.stall_angle
    induced = 1.0 / (math.pi * fins.oswald_efficiency * fins.aspect_ratio)
    sharpness = 1.0 / fins.stall_width
    sin, cos, tanh = maths.sin, maths.cos, maths.tanh

    def coefficients(angle: Number) -> tuple[Number, Number]:
        stalled = 0.5 + 0.5 * tanh(sharpness * (abs(angle) - stall))
        attached = 1.0 - stalled
        sine = sin(angle)
        plate = 2.0 * abs(sine) * stalled
        linear = slope * angle
        lift = attached * linear + plate * sine * cos(angle)
        drag = base + attached * induced * linear * linear + plate * abs(sine)
        return lift, drag

    return coefficients


def fin_wrench(vehicle: Vehicle, maths: Maths[Number]) -> Callable[..., Wrench[Number]]:
    """Build the wrench of all fins.

    The function takes (u, v, w, p, q, r) relative to the water in the platform frame (m/s, rad/s) and the
    tuple of deflections (rad), and returns (X, Y, Z, K, M, N) in N, N m. Each fin sees the inflow at its
    own centre (Prestero 2001, Eq. 4.40, all terms kept), so fins damp yaw, pitch and roll by themselves.
    """
    fins = vehicle.fins
    x, radius = fins.position_x, fins.centre_radius
    pressure_area = 0.5 * vehicle.water.density * fins.area
    normals = [(math.cos(a), math.sin(a)) for a in fins.azimuth]
    coefficients = lift_and_drag(vehicle, maths)
    sqrt, atan2 = maths.sqrt, maths.atan2

    def wrench(
        u: Number,
        v: Number,
        w: Number,
        p: Number,
        q: Number,
        r: Number,
        deflections: tuple[Number, Number, Number, Number],
    ) -> Wrench[Number]:
        sway = v + x * r
        heave = w - x * q
        spin = radius * p
        total_x = total_y = total_z = total_k = total_m = total_n = 0.0 * u
        for (c, s), deflection in zip(normals, deflections, strict=True):
            axial = u + radius * (s * q - c * r)
            normal = c * heave - s * sway + spin
            speed = sqrt(axial * axial + normal * normal)
            lift, drag = coefficients(atan2(normal, axial) - deflection)
            scale = pressure_area * speed
            thrust = scale * (lift * normal - drag * axial)
            push = -scale * (lift * axial + drag * normal)
            total_x = total_x + thrust
            total_y = total_y - s * push
            total_z = total_z + c * push
            total_k = total_k + radius * push
            total_m = total_m + radius * s * thrust - x * c * push
            total_n = total_n - radius * c * thrust - x * s * push
        return total_x, total_y, total_z, total_k, total_m, total_n

    return wrench
