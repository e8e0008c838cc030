"""The equations of motion on components: from rigid body and actuators to their time derivatives.

M nu_r' + C_RB(nu_r) nu_r + C_A(nu_r) nu_r + D(nu_r) nu_r + g(eta) = tau (Fossen 2021, for an
irrotational current), in the platform frame with its origin at the centre of buoyancy. The rotation of the
Earth turns the frame far too slowly to push the vehicle; it enters the ideal sensors (`truth`), not the
forces.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from bottomlock.plant.fins import fin_wrench
from bottomlock.plant.hull import hull_wrench
from bottomlock.plant.lanes import Lane, Maths
from bottomlock.plant.matrices import added_mass_matrix, centre_of_gravity_p_m, rigid_body_mass_matrix
from bottomlock.plant.propeller import propeller_wrench
from bottomlock.plant.vehicle import Vehicle

Six: TypeAlias = tuple[Lane, Lane, Lane, Lane, Lane, Lane]
Three: TypeAlias = tuple[Lane, Lane, Lane]
Four: TypeAlias = tuple[Lane, Lane, Lane, Lane]
Water: TypeAlias = tuple[Lane, Lane, Lane, Lane]


def to_platform(q0: Lane, q1: Lane, q2: Lane, q3: Lane, n: Lane, e: Lane, d: Lane) -> Three[Lane]:
    """Turn a tangent vector into the platform frame: R' a, with the quaternion of platform to tangent."""
    # a - 2 q0 (q x a) + 2 q x (q x a), the transpose of the usual two cross products
    x = 2.0 * (q2 * d - q3 * e)
    y = 2.0 * (q3 * n - q1 * d)
    z = 2.0 * (q1 * e - q2 * n)
    return n - q0 * x + q2 * z - q3 * y, e - q0 * y + q3 * x - q1 * z, d - q0 * z + q1 * y - q2 * x


def to_tangent(q0: Lane, q1: Lane, q2: Lane, q3: Lane, a: Lane, b: Lane, c: Lane) -> Three[Lane]:
    """Turn a platform vector into the tangent frame: R a."""
    x = 2.0 * (q2 * c - q3 * b)
    y = 2.0 * (q3 * a - q1 * c)
    z = 2.0 * (q1 * b - q2 * a)
    return a + q0 * x + q2 * z - q3 * y, b + q0 * y + q3 * x - q1 * z, c + q0 * z + q1 * y - q2 * x


def acceleration(
    vehicle: Vehicle, gravity_mps2: float, maths: Maths[Lane]
) -> Callable[[Four[Lane], Six[Lane], Four[Lane], Lane, Three[Lane], Three[Lane]], Six[Lane]]:
    """Build nu' as a function of the whole mechanical state.

    The function takes the attitude quaternion (scalar first, platform to tangent), nu (m/s, rad/s, over
    ground), the fin deflections (rad), the shaft speed (rev/s), the current at the vehicle and its rate of
    change along the vehicle's way (tangent, m/s and m/s²), and returns nu' (m/s², rad/s²).
    """
    body = vehicle.rigid_body
    mass = body.mass
    xg, yg, zg = (float(value) for value in centre_of_gravity_p_m(vehicle))
    ixx, iyy, izz = body.inertia_xx, body.inertia_yy, body.inertia_zz
    weight = mass * gravity_mps2
    surplus = weight - vehicle.water.density * body.displaced_volume * gravity_mps2
    added = added_mass_matrix(vehicle)
    a11, a22, a33, a44, a55, a66 = (float(value) for value in np.diag(added))
    a26, a35 = float(added[1, 5]), float(added[2, 4])
    inverse = np.linalg.inv(rigid_body_mass_matrix(vehicle) + added)
    rows = [tuple(float(value) for value in row) for row in inverse]
    hull = hull_wrench(vehicle, maths)
    fins = fin_wrench(vehicle, maths)
    propeller = propeller_wrench(vehicle, maths)

    def nu_dot(
        attitude: Four[Lane],
        nu: Six[Lane],
        deflections: Four[Lane],
        shaft: Lane,
        water: Three[Lane],
        swell: Three[Lane],
    ) -> Six[Lane]:
        q0, q1, q2, q3 = attitude
        u, v, w, p, q, r = nu
        uc, vc, wc = to_platform(q0, q1, q2, q3, *water)
        u, v, w = u - uc, v - vc, w - wc
        # momentum of body and water; C nu = (omega x linear, omega x angular + v x linear), added mass and
        # body apart
        lx, ly, lz = a11 * u, a22 * v + a26 * r, a33 * w + a35 * q
        hx, hy, hz = a44 * p, a35 * w + a55 * q, a26 * v + a66 * r
        # velocity of the centre of gravity, whose omega x (.) is the body's own Coriolis force
        gx, gy, gz = u + q * zg - r * yg, v + r * xg - p * zg, w + p * yg - q * xg
        fx, fy, fz = mass * (q * gz - r * gy), mass * (r * gx - p * gz), mass * (p * gy - q * gx)
        ox, oy, oz = mass * (q * w - r * v), mass * (r * u - p * w), mass * (p * v - q * u)
        jx, jy, jz = hx + ixx * p, hy + iyy * q, hz + izz * r
        down_x, down_y = 2.0 * (q1 * q3 - q0 * q2), 2.0 * (q2 * q3 + q0 * q1)
        down_z = 1.0 - 2.0 * (q1 * q1 + q2 * q2)
        hull_x, hull_y, hull_z, hull_k, hull_m, hull_n = hull(u, v, w, p, q, r)
        fin_x, fin_y, fin_z, fin_k, fin_m, fin_n = fins(u, v, w, p, q, r, deflections)
        thrust, torque = propeller(u, shaft)
        tx = hull_x + fin_x + thrust - fx - (q * lz - r * ly) + surplus * down_x
        ty = hull_y + fin_y - fy - (r * lx - p * lz) + surplus * down_y
        tz = hull_z + fin_z - fz - (p * ly - q * lx) + surplus * down_z
        tk = (
            hull_k
            + fin_k
            + torque
            - (q * jz - r * jy)
            - (v * lz - w * ly)
            - (yg * oz - zg * oy)
            + weight * (yg * down_z - zg * down_y)
        )
        tm = (
            hull_m
            + fin_m
            - (r * jx - p * jz)
            - (w * lx - u * lz)
            - (zg * ox - xg * oz)
            + weight * (zg * down_x - xg * down_z)
        )
        tn = (
            hull_n
            + fin_n
            - (p * jy - q * jx)
            - (u * ly - v * lx)
            - (xg * oy - yg * ox)
            + weight * (xg * down_y - yg * down_x)
        )
        ud, vd, wd, pd, qd, rd = [
            m0 * tx + m1 * ty + m2 * tz + m3 * tk + m4 * tm + m5 * tn for m0, m1, m2, m3, m4, m5 in rows
        ]
        ax, ay, az = to_platform(q0, q1, q2, q3, *swell)
        # the current in the platform frame changes as the vehicle turns: d(R' c)/dt = R' c' - omega x R' c
        return (
            ud + ax - (q * wc - r * vc),
            vd + ay - (r * uc - p * wc),
            wd + az - (p * vc - q * uc),
            pd,
            qd,
            rd,
        )

    return nu_dot
