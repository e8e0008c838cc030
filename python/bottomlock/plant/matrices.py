"""Mass matrices M_RB and M_A of the equations of motion (Fossen 2021, chapters 3 and 6), and rotations.

The simulator runs the equations on components (`equations`); a test holds them equal to the vectorial form.
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
