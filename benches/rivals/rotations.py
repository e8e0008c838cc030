"""Rotations as matrices, for any leading axes: platform to tangent, with misalignments in the tangent frame."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SMALL_RAD = 1e-4
"""Below this angle the coefficients of sine and cosine come from their series."""


def skew(vector: Floats) -> Floats:
    """[a ×] of vectors (..., 3), as (..., 3, 3)."""
    out: Floats = np.zeros((*vector.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -vector[..., 2], vector[..., 1]
    out[..., 1, 0], out[..., 1, 2] = vector[..., 2], -vector[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -vector[..., 1], vector[..., 0]
    return out


def _coefficients(angle: Floats) -> tuple[Floats, Floats, Floats]:
    """Sin x / x, (1 - cos x) / x² and (x - sin x) / x³."""
    square = angle * angle
    small = angle < SMALL_RAD
    safe = np.where(small, 1.0, angle)
    return (
        np.where(small, 1.0 - square / 6.0, np.sin(safe) / safe),
        np.where(small, 0.5 - square / 24.0, (1.0 - np.cos(safe)) / safe**2),
        np.where(small, 1.0 / 6.0 - square / 120.0, (safe - np.sin(safe)) / safe**3),
    )


def exp(vector: Floats) -> Floats:
    """Exp([a ×]) of rotation vectors (..., 3), rad."""
    first, second, _ = _coefficients(np.linalg.norm(vector, axis=-1)[..., None, None])
    cross = skew(vector)
    out: Floats = np.eye(3) + first * cross + second * (cross @ cross)
    return out


def left_jacobian(vector: Floats) -> Floats:
    """J with Exp(a) = I + J [a ×]: what a constant turn does to a constant rate, (..., 3, 3)."""
    _, second, third = _coefficients(np.linalg.norm(vector, axis=-1)[..., None, None])
    cross = skew(vector)
    out: Floats = np.eye(3) + second * cross + third * (cross @ cross)
    return out


def log(rotation: Floats) -> Floats:
    """Rotation vector (..., 3), rad, of rotations by less than π."""
    q = quaternion(rotation)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    small = sine < SMALL_RAD
    out: Floats = q[..., 1:] * np.where(small, 2.0 / q[..., :1], angle / np.where(small, 1.0, sine))
    return out


def matrix(q: Floats) -> Floats:
    """Matrix of a unit quaternion, scalar first: (..., 4) to (..., 3, 3)."""
    cross = skew(q[..., 1:])
    out: Floats = np.eye(3) + 2.0 * (q[..., :1, None] * cross + cross @ cross)
    return out


def quaternion(rotation: Floats) -> Floats:
    """Unit quaternion, scalar first, of rotations: (..., 3, 3) to (..., 4)."""
    # The four products 4 q qᵀ: the row with the largest diagonal divides without loss (Shepperd 1978).
    m = rotation
    products: Floats = np.empty((*m.shape[:-2], 4, 4))
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    products[..., 0, 0] = 1.0 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[..., i + 1, i + 1] = 1.0 + 2.0 * m[..., i, i] - trace
        products[..., 0, i + 1] = products[..., i + 1, 0] = m[..., k, j] - m[..., j, k]
        products[..., j + 1, k + 1] = products[..., k + 1, j + 1] = m[..., k, j] + m[..., j, k]
    row = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(products, row[..., None, None], axis=-2)[..., 0, :]
    out: Floats = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return out


def yaw_rad(rotation: Floats) -> Floats:
    """Angle of the bow from north towards east, rad."""
    out: Floats = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    return out


def wrapped(angle: Floats) -> Floats:
    """An angle in -π to π, rad."""
    out: Floats = np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi
    return out
