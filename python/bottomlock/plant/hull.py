"""Drag and lift of the hull: axial drag, body lift, cross-flow drag by strips, rotary drag.

Every term opposes the local velocity, so that each dissipates energy in any state.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.integrate import trapezoid

from bottomlock.plant.maths import FloatArray, Maths, Number
from bottomlock.plant.vehicle import Hull, Vehicle

Wrench: TypeAlias = tuple[Number, Number, Number, Number, Number, Number]
Strip: TypeAlias = tuple[float, float]

STRIPS = 6


def myring_radius_m(hull: Hull, from_nose_m: FloatArray) -> FloatArray:
    """Hull radius at stations aft of the nose tip, m.

    Myring 1976 as Prestero 2001, Eqs. 2.1 and 2.2, without his offsets: nose and tail are whole.
    """
    nose, tail, length, diameter = hull.nose_length, hull.tail_length, hull.length, hull.diameter
    x = np.asarray(from_nose_m, dtype=np.float64)
    fore = np.clip((x - nose) / nose, -1.0, 0.0)
    nose_radius = 0.5 * diameter * (1.0 - fore**2) ** (1.0 / hull.nose_exponent)
    aft = np.clip(x - (length - tail), 0.0, tail)
    slope = np.tan(hull.tail_angle)
    tail_radius = (
        0.5 * diameter
        - (1.5 * diameter / tail**2 - slope / tail) * aft**2
        + (diameter / tail**3 - slope / tail**2) * aft**3
    )
    inside = (x >= 0.0) & (x <= length)
    return np.where(inside, np.maximum(np.where(x < nose, nose_radius, tail_radius), 0.0), 0.0)


def cross_flow_strips(vehicle: Vehicle, count: int = STRIPS) -> list[Strip]:
    """Gauss-Legendre strips along the hull: (station x m, drag weight rho/2 Cd d dx in kg/m).

    The weights contain the hull's diameter along Myring's shape, scaled so that the total is that of the exact plan
    area.
    """
    hull = vehicle.hull
    nodes, weights = np.polynomial.legendre.leggauss(count)
    from_nose = 0.5 * hull.length * (nodes + 1.0)
    widths = 0.5 * hull.length * weights * 2.0 * myring_radius_m(hull, from_nose)
    fine = np.linspace(0.0, hull.length, 4001)
    plan_area = float(trapezoid(2.0 * myring_radius_m(hull, fine), fine))
    widths *= plan_area / float(widths.sum())
    drag = 0.5 * vehicle.water.density * hull.cross_flow_drag * widths
    stations = hull.centre_of_buoyancy_from_nose - from_nose
    return [(float(x), float(k)) for x, k in zip(stations, drag, strict=True)]


def hull_wrench(
    vehicle: Vehicle, maths: Maths[Number]
) -> Callable[[Number, Number, Number, Number, Number, Number], Wrench[Number]]:
    """Build the hull's damping wrench as a function of velocity relative to the water.

    The function takes (u, v, w, p, q, r) in the platform frame (m/s, rad/s) and returns (X, Y, Z, K, M, N) in N, N m.

    Source: axial drag, Prestero 2001, Eq. 4.5; body lift, Eqs. 4.33 to 4.36, with the inflow at the centre of pressure;
    cross-flow drag by strips, Eq. 4.8 and MSS crossFlowDrag.m, with the resultant cross flow.
    """
    hull = vehicle.hull
    axial, lift, arm, roll = hull.axial_drag, hull.lift, hull.centre_of_pressure_x, hull.roll_drag
    pitch_drag, yaw_drag = hull.pitch_drag, hull.yaw_drag
    strips = cross_flow_strips(vehicle)
    sqrt = maths.sqrt

    def wrench(u: Number, v: Number, w: Number, p: Number, q: Number, r: Number) -> Wrench[Number]:
        ahead = abs(u)
        side = -lift * ahead * (v + arm * r)
        heave = -lift * ahead * (w - arm * q)
        yaw = arm * side - yaw_drag * abs(r) * r
        pitch = -arm * heave - pitch_drag * abs(q) * q
        for x, k in strips:
            across = v + x * r
            down = w - x * q
            pull = k * sqrt(across * across + down * down)
            across = pull * across
            down = pull * down
            side = side - across
            heave = heave - down
            yaw = yaw - x * across
            pitch = pitch + x * down
        return -axial * ahead * u, side, heave, -roll * abs(p) * p, pitch, yaw

    return wrench
