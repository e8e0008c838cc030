"""The few rotations that messages and live readings need, without scipy; quaternions are scalar first."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bottomlock.recordings.streams import Floats

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Axes = tuple[Axis, Axis, Axis]
"""For each axis of the platform the sensor's, with its sign."""
UNCHANGED_AXES: Axes = ("x", "y", "z")

FLU_FROM_FRD = np.array([1.0, -1.0, -1.0])
"""Forward-right-down to forward-left-up: the same forward axis, the other two reversed."""
QUATERNION_FLU_FRD = np.array([0.0, 1.0, 0.0, 0.0])
"""The same as a rotation, half a turn about the forward axis, in either direction."""
QUATERNION_ENU_NED = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""North-east-down to east-north-up and back: half a turn about the horizontal axis between north and east."""


def check_axes(axes: Axes) -> None:
    """Checks that each sensor axis is named once.

    Raises:
        ValueError: for an axis that is named twice.
    """
    if len({axis.removeprefix("-") for axis in axes}) != 3:
        raise ValueError(f"axes is {list(axes)}, expected each of x, y, z once, with or without a minus")


def permute_axes(values: Floats, axes: Axes) -> Floats:
    """(n, 3) readings reordered: `axes` names, for each platform axis, the sensor axis and its sign.

    >>> permute_axes(np.array([[1.0, 2.0, 3.0]]), ("x", "-y", "z")).tolist()
    [[1.0, -2.0, 3.0]]
    """
    columns = [("xyz".index(axis[-1]), -1.0 if axis.startswith("-") else 1.0) for axis in axes]
    return np.stack([sign * values[:, column] for column, sign in columns], axis=1)


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """Unit quaternion of Euler angles z-y-x, rad.

    >>> quaternion(0.0, 0.0, math.pi / 2)
    (0.7071067811865476, 0.0, 0.0, 0.7071067811865475)
    """
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def angles(attitude: Floats | tuple[float, float, float, float]) -> tuple[float, float, float]:
    """Euler angles z-y-x of a unit quaternion: roll, pitch, yaw, rad; to the bit as `recordings.axes.to_angles`.

    Source: Bernardes & Viollet, Quaternion to Euler angles conversion, PLoS ONE 17 (2022), as scipy has it.

    >>> [round(angle, 12) for angle in angles(quaternion(0.1, -0.2, 3.0))]
    [0.1, -0.2, 3.0]
    """
    w, x, y, z = map(float, attitude)
    half_sum, half_difference = math.atan2(x + z, w - y), math.atan2(z - x, w + y)
    # Of numpy, whose bits are those of the C library: math.hypot has its own.
    pitch = 2.0 * math.atan2(float(np.hypot(w + y, z - x)), float(np.hypot(w - y, x + z))) - 0.5 * math.pi
    return _turn(half_sum - half_difference), pitch, _turn(half_sum + half_difference)


def _turn(angle: float) -> float:
    """An angle within two turns as one from -pi to pi."""
    return angle - math.copysign(2.0 * math.pi, angle) if abs(angle) > math.pi else angle


def product(first: Floats, then: Floats) -> Floats:
    """Quaternion of the rotation `then` followed by `first`, scalar first.

    >>> half = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    >>> product(half, half).round(12).tolist()
    [0.0, 0.0, 0.0, 1.0]
    """
    w1, v1, w2, v2 = first[0], first[1:], then[0], then[1:]
    return np.concatenate([[w1 * w2 - v1 @ v2], w1 * v2 + w2 * v1 + np.cross(v1, v2)])


def matrix(attitude: Floats) -> Floats:
    """Rotation matrix (3, 3) of a unit quaternion.

    >>> (matrix(np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])) @ [1.0, 0.0, 0.0]).round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    return np.ascontiguousarray(matrices(attitude))


def matrices(attitudes: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(np.asarray(attitudes), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def skew(vectors: Floats) -> Floats:
    """[a x] (..., 3, 3) of vectors (..., 3): [a x] b = a x b."""
    found = np.zeros((*vectors.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[..., j, i], found[..., i, j] = vectors[..., k], -vectors[..., k]
    return found


def rotation_matrices(vectors: Floats) -> Floats:
    """(..., 3, 3) rotation matrices of rotation vectors (..., 3), rad (Rodrigues).

    >>> (rotation_matrices(np.array([0.0, 0.0, np.pi / 2])) @ [1.0, 0.0, 0.0]).round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    K = skew(vectors)
    half = 0.5 * np.linalg.norm(vectors, axis=-1)[..., None, None]
    # sin x / x and (1 − cos x) / x² by half the angle, where both are well conditioned.
    first, second = np.sinc(2.0 * half / np.pi), 0.5 * np.sinc(half / np.pi) ** 2
    return np.asarray(np.eye(3) + first * K + second * (K @ K))


def rotation_vectors(matrices: Floats) -> Floats:
    """(n, 3) rotation vectors of rotation matrices (n, 3, 3) of less than half a turn, rad.

    >>> turn = np.array([[0.1, -0.2, 0.3]])
    >>> rotation_vectors(rotation_matrices(turn)).round(12).tolist()
    [[0.1, -0.2, 0.3]]
    """
    pairs = ((2, 1), (0, 2), (1, 0))
    sine = np.stack([0.5 * (matrices[:, i, j] - matrices[:, j, i]) for i, j in pairs], axis=1)
    size = np.linalg.norm(sine, axis=1)
    angle = np.arctan2(size, 0.5 * (np.trace(matrices, axis1=1, axis2=2) - 1.0))
    return np.asarray(sine * np.where(size < 1e-12, 1.0, angle / np.maximum(size, 1e-12))[:, None])


def rotation_vector(first: Floats, then: Floats) -> Floats:
    """(3,) turn from one attitude to the next, in platform axes, rad: Log(q1^-1 q2).

    >>> yaw = np.array([np.cos(0.05), 0.0, 0.0, np.sin(0.05)])
    >>> rotation_vector(np.array([1.0, 0.0, 0.0, 0.0]), yaw).round(12).tolist()
    [0.0, 0.0, 0.1]
    """
    w1, v1 = float(first[0]), -first[1:]
    w2, v2 = float(then[0]), then[1:]
    scalar = w1 * w2 - float(v1 @ v2)
    vector: Floats = w1 * v2 + w2 * v1 + np.cross(v1, v2)
    if scalar < 0.0:
        scalar, vector = -scalar, -vector
    sine = float(np.linalg.norm(vector))
    return vector * (2.0 if sine < 1e-12 else 2.0 * float(np.arctan2(sine, scalar)) / sine)


def level_from_force(force_p_mps2: NDArray[np.float64]) -> tuple[float, float]:
    """Roll and pitch, rad, of a platform at rest from its specific force (3,), which points up.

    >>> level_from_force(np.array([0.0, 0.0, -9.81]))
    (0.0, 0.0)
    >>> [round(angle, 6) for angle in level_from_force(np.array([1.949, -0.960, -9.570]))]
    [0.099979, 0.199933]
    """
    x, y, z = (float(part) for part in force_p_mps2)
    # Adding 0.0 makes a negative zero positive.
    return float(np.arctan2(-y, -z)) + 0.0, float(np.arctan2(x, np.hypot(y, z))) + 0.0
