"""Rotations written out: cross matrices, exponentials by power series, Euler angles, quaternions scalar first.

Everything is analytic in its arguments (no absolute value, no conjugate), so a complex step passes through it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Real or complex: the complex step needs both.
Array = NDArray[Any]


def skew(a: Array) -> Array:
    """The matrix [a×] with [a×] b = a × b."""
    zero = a[0] * 0
    return np.array([[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]])


def unskew(m: Array) -> Array:
    """The vector of the skew part of a matrix: the inverse of `skew`."""
    return np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2


def exp_rotation(vector: Array) -> Array:
    """Exp([a×]) as its power series, summed until nothing is left at double precision for |a| up to 2π."""
    generator = skew(vector)
    total = np.eye(3, dtype=generator.dtype)
    term = np.eye(3, dtype=generator.dtype)
    for k in range(1, 60):
        term = term @ generator / k
        total = total + term
    return total


def log_rotation(rotation: Array) -> Array:
    """The rotation vector of a matrix, for angles below π."""
    sine_axis = unskew(rotation)
    sine = np.sqrt(np.sum(sine_axis**2))
    cosine = (np.trace(rotation) - 1) / 2
    angle = np.arctan2(sine, cosine)
    vector: Array = sine_axis * (1.0 if sine < 1e-9 else angle / sine)
    return vector


def matrix_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Platform to tangent, z-y-x: three elementary matrices multiplied in the order of the convention."""
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    cy, sy = np.cos(yaw_rad), np.sin(yaw_rad)
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    rotation: Array = about_z @ about_y @ about_x
    return rotation


def matrix_from_quaternion(q: Array) -> Array:
    """Rotation matrix of a quaternion (w, x, y, z): Rodrigues' formula (w² − |n|²) I + 2 n nᵀ + 2 w [n×], over |q|²."""
    w, n = q[0], q[1:]
    numerator = (w * w - n @ n) * np.eye(3) + 2 * np.outer(n, n) + 2 * w * skew(n)
    rotation: Array = numerator / (w * w + n @ n)
    return rotation


def quaternion_from_euler(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Quaternion (w, x, y, z) of the z-y-x angles, as the product of three half-angle quaternions."""
    about_z = np.array([np.cos(yaw_rad / 2), 0, 0, np.sin(yaw_rad / 2)])
    about_y = np.array([np.cos(pitch_rad / 2), 0, np.sin(pitch_rad / 2), 0])
    about_x = np.array([np.cos(roll_rad / 2), np.sin(roll_rad / 2), 0, 0])
    return quaternion_product(quaternion_product(about_z, about_y), about_x)


def quaternion_product(a: Array, b: Array) -> Array:
    """Hamilton's product: scalar a₀b₀ − a·b, vector a₀ b + b₀ a + a × b."""
    scalar = a[0] * b[0] - a[1:] @ b[1:]
    return np.concatenate([[scalar], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])])
