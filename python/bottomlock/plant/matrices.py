"""The vectorial form of the equations of motion: M_RB, M_A, C_RB, C_A and g(eta) as matrices.

These are the reference form (Fossen 2021, chapters 3, 4, 6 and 8) for trim, linearisation and tests; the
simulator runs the same terms written out on components (`equations`), and a test holds the two equal.
"""

import numpy as np

from bottomlock.plant.hovering_vehicle import AnyVehicle
from bottomlock.plant.maths import FloatArray


def skew(vector: FloatArray) -> FloatArray:
    """S(a) with S(a) b = a x b, shape (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def centre_of_gravity_p_m(vehicle: AnyVehicle) -> FloatArray:
    """r_g from the centre of buoyancy, platform frame, m."""
    body = vehicle.rigid_body
    return np.array([body.centre_of_gravity_x, body.centre_of_gravity_y, body.centre_of_gravity_z])


def rigid_body_mass_matrix(vehicle: AnyVehicle) -> FloatArray:
    """M_RB about the centre of buoyancy, shape (6, 6); Fossen 2021, chapter 3."""
    body = vehicle.rigid_body
    coupling = body.mass * skew(centre_of_gravity_p_m(vehicle))
    inertia = np.diag([body.inertia_xx, body.inertia_yy, body.inertia_zz])
    return np.block([[body.mass * np.eye(3), -coupling], [coupling, inertia]])


def added_mass_matrix(vehicle: AnyVehicle) -> FloatArray:
    """M_A, shape (6, 6), symmetric, of a body with two planes of symmetry; Fossen 2021, chapter 6."""
    added = vehicle.added_mass
    matrix = -np.diag([added.x_udot, added.y_vdot, added.z_wdot, added.k_pdot, added.m_qdot, added.n_rdot])
    matrix[1, 5] = matrix[5, 1] = -added.y_rdot
    matrix[2, 4] = matrix[4, 2] = -added.z_qdot
    return matrix


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


def rotation_t_p(quaternion_t_p: FloatArray) -> FloatArray:
    """Rotation matrix of a unit quaternion (scalar first): platform vectors to tangent."""
    w, x, y, z = quaternion_t_p
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def restoring_vector(vehicle: AnyVehicle, quaternion_t_p: FloatArray, gravity_mps2: float) -> FloatArray:
    """g(eta), shape (6,): what weight and buoyancy need to be held, N and N m; as MSS gRvect.m."""
    body = vehicle.rigid_body
    weight = body.mass * gravity_mps2
    buoyancy = vehicle.water.density * body.displaced_volume * gravity_mps2
    down_p = rotation_t_p(quaternion_t_p)[2]
    moment = np.cross(centre_of_gravity_p_m(vehicle), weight * down_p)
    return -np.concatenate([(weight - buoyancy) * down_p, moment])
