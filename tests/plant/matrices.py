"""The vectorial form of the equations of motion: C_RB, C_A, D and g(eta), apart from the plant's components.

Fossen 2021, chapters 3, 4, 6 and 8.
"""

import numpy as np

from bottomlock.plant import Vehicle
from bottomlock.plant.equations import (
    added_mass_matrix,
    centre_of_gravity_p_m,
    cross_flow_strips,
)
from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import FloatArray
from bottomlock.recordings.rotation import matrices, skew


def rigid_body_coriolis_matrix(vehicle: AnyVehicle, nu: FloatArray) -> FloatArray:
    """C_RB in the form free of linear velocity, shape (6, 6), skew; Fossen 2021, section 3.3.1, as MSS rbody.m.

    This form keeps M_RB and C_RB valid for the velocity relative to an irrotational current.
    """
    body = vehicle.rigid_body
    rate, offset = skew(nu[3:]), skew(centre_of_gravity_p_m(vehicle))
    inertia = np.diag([body.inertia_xx, body.inertia_yy, body.inertia_zz])
    return np.block(
        [[body.mass * rate, -body.mass * rate @ offset], [body.mass * offset @ rate, -skew(inertia @ nu[3:])]]
    )


def added_mass_coriolis_matrix(vehicle: AnyVehicle, nu_r: FloatArray) -> FloatArray:
    """C_A(nu_r), shape (6, 6), skew; as MSS m2c.m of M_A, which names Theorem 3.2 of Fossen."""
    momentum = added_mass_matrix(vehicle) @ nu_r
    linear, angular = skew(momentum[:3]), skew(momentum[3:])
    return np.block([[np.zeros((3, 3)), -linear], [-linear, -angular]])


def hull_damping_matrix(vehicle: Vehicle, nu_r: FloatArray) -> FloatArray:
    """D(nu_r) of the hull, shape (6, 6), symmetric and never negative.

    D(nu_r) nu_r is minus the hull's damping wrench.
    """
    hull = vehicle.hull
    u, v, w, p, q, r = nu_r
    matrix = np.zeros((6, 6))
    matrix[0, 0] = hull.axial_drag * abs(u)
    matrix[3, 3] = hull.roll_drag * abs(p)
    matrix[4, 4] = hull.pitch_drag * abs(q)
    matrix[5, 5] = hull.yaw_drag * abs(r)
    lines = [(hull.centre_of_pressure_x, hull.lift * abs(u))]
    lines += [(x, k * float(np.hypot(v + x * r, w - x * q))) for x, k in cross_flow_strips(vehicle)]
    for x, k in lines:
        sideways = np.array([0.0, 1.0, 0.0, 0.0, 0.0, x])
        downward = np.array([0.0, 0.0, 1.0, 0.0, -x, 0.0])
        matrix += k * (np.outer(sideways, sideways) + np.outer(downward, downward))
    return matrix


def restoring_vector(vehicle: AnyVehicle, quaternion_t_p: FloatArray, gravity_mps2: float) -> FloatArray:
    """g(eta), shape (6,): what weight and buoyancy need to be held, N and N m; as MSS gRvect.m."""
    body = vehicle.rigid_body
    weight = body.mass * gravity_mps2
    buoyancy = vehicle.water.density * body.displaced_volume * gravity_mps2
    down_p = matrices(quaternion_t_p)[2]
    moment = np.cross(centre_of_gravity_p_m(vehicle), weight * down_p)
    return -np.concatenate([(weight - buoyancy) * down_p, moment])
