"""Second derivation of F and G: the nonlinear truth and the nonlinear estimate differenced, then a complex step.

No block of Eqs. 4 and 5 appears here. The truth follows the mechanisation with the true rate and force; the estimate
the same with the readings less the estimated biases. The error is defined by x = x̂ ⊞ δx with R = Exp([ρ×]) R̂, and its
rate of change is differentiated at δx = 0 by an imaginary step of 1e-30, which has no cancellation.
"""

from dataclasses import dataclass

import numpy as np

from tests.oracle.rotations import Array, exp_rotation, skew, unskew

STEP = 1e-30


@dataclass(frozen=True)
class Point:
    """An estimate and what the sensors say there."""

    rotation: Array
    velocity: Array
    rate_reading: Array
    force_reading: Array
    accel_bias: Array
    gyro_bias: Array
    gravity_t: Array
    earth_rate_t: Array


def kinematics(
    rotation: Array, velocity: Array, rate_ip: Array, force: Array, gravity_t: Array, earth_rate_t: Array
) -> tuple[Array, Array, Array]:
    """Rates of position (tangent), rotation matrix and platform velocity."""
    earth_rate_p = rotation.T @ earth_rate_t
    position_rate = rotation @ velocity
    rotation_rate = rotation @ skew(rate_ip - earth_rate_p)
    velocity_rate = force + rotation.T @ gravity_t - skew(rate_ip + earth_rate_p) @ velocity
    return position_rate, rotation_rate, velocity_rate


def error_rate(point: Point, error: Array, noise: Array) -> Array:
    """Rate of change of the 20-state error for an error (20,) and a noise (17,) in the order of Eqs. 8 and 11."""
    exp_rho = exp_rotation(error[3:6])
    true_rotation = exp_rho @ point.rotation
    true_velocity = point.velocity + error[6:9]
    # A reading is truth + bias + noise, so truth is reading − bias − noise.
    true_force = point.force_reading - (point.accel_bias + error[9:12]) - noise[0:3]
    true_rate = point.rate_reading - (point.gyro_bias + error[12:15]) - noise[3:6]
    fixed = (point.gravity_t, point.earth_rate_t)
    r_dot, rot_dot, v_dot = kinematics(true_rotation, true_velocity, true_rate, true_force, *fixed)
    r_hat_dot, rot_hat_dot, v_hat_dot = kinematics(
        point.rotation,
        point.velocity,
        point.rate_reading - point.gyro_bias,
        point.force_reading - point.accel_bias,
        *fixed,
    )
    # E = R R̂ᵀ = Exp([ρ×]); Ė Eᵀ = [J ρ̇ ×], J the left Jacobian Σ [ρ×]^k / (k+1)!.
    error_matrix_rate = rot_dot @ point.rotation.T + true_rotation @ rot_hat_dot.T
    spatial_rate = unskew(error_matrix_rate @ exp_rho.T)
    generator = skew(error[3:6])
    jacobian = np.eye(3) + generator / 2 + generator @ generator / 6
    rho_dot = np.linalg.solve(jacobian, spatial_rate)
    return np.concatenate([r_dot - r_hat_dot, rho_dot, v_dot - v_hat_dot, noise[6:17]])


def differentiate(point: Point) -> tuple[Array, Array]:
    """F (20 × 20) and G (20 × 17) by complex step."""
    F, G = np.zeros((20, 20)), np.zeros((20, 17))
    for column in range(20):
        error = np.zeros(20, dtype=complex)
        error[column] = 1j * STEP
        F[:, column] = error_rate(point, error, np.zeros(17)).imag / STEP
    for column in range(17):
        noise = np.zeros(17, dtype=complex)
        noise[column] = 1j * STEP
        G[:, column] = error_rate(point, np.zeros(20, dtype=complex), noise).imag / STEP
    return F, G
