"""Sensor axes to platform axes, and attitudes between Euler angles and quaternions."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from bottomlock.recordings.rotation import Axes, permute_axes
from bottomlock.recordings.streams import Floats

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Symmetric: the same matrix takes east–north–up to north–east–down."""
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])


def handedness(axes: Axes) -> int:
    """+1 for right-handed sensor axes, as the platform's are; −1 for left-handed ones."""
    return round(float(np.linalg.det(permute_axes(np.eye(3), axes))))


def from_angles(roll_rad: ArrayLike, pitch_rad: ArrayLike, yaw_rad: ArrayLike) -> Rotation:
    """Rotations from platform to tangent frame, from Euler angles z-y-x, rad."""
    angles = np.stack(np.broadcast_arrays(yaw_rad, pitch_rad, roll_rad), axis=-1)
    return Rotation.from_euler("ZYX", angles)


def to_angles(attitude: Rotation) -> Floats:
    """(..., 3) roll, pitch, yaw, rad, of rotations from platform to tangent frame."""
    return np.asarray(attitude.as_euler("ZYX")[..., ::-1])


def quaternions(attitude: Rotation) -> Floats:
    """(..., 4) quaternions, scalar first (scipy keeps the scalar last)."""
    return np.ascontiguousarray(np.roll(attitude.as_quat(), 1, axis=-1))


def from_quaternions(attitude_t_p: ArrayLike) -> Rotation:
    """Rotations from (..., 4) quaternions, scalar first."""
    return Rotation.from_quat(np.roll(np.asarray(attitude_t_p, dtype=np.float64), -1, axis=-1))


def to_platform_axes(values: Floats, axes: Axes, mounting_rpy_rad: ArrayLike) -> Floats:
    """(n, 3) readings in platform axes: reordered by `axes`, then rotated by the mounting (roll, pitch, yaw)."""
    return np.asarray(from_angles(*np.asarray(mounting_rpy_rad)).apply(permute_axes(values, axes)))


def platform_attitude(
    attitude: Rotation, frame: str, mounting_rpy_rad: ArrayLike, yaw_offset_rad: float
) -> Rotation:
    """Attitudes of the platform from those of an attitude sensor on it.

    Args:
        attitude: of the sensor, in its own frames.
        frame: "ned_frd", or "enu_flu": Euler angles z-y-x between east–north–up and forward–left–up.
        mounting_rpy_rad: (3,) roll, pitch, yaw from sensor to platform axes.
        yaw_offset_rad: added about the vertical, for instance a declination.
    """
    if frame == "enu_flu":
        attitude = Rotation.from_matrix(ENU_FROM_NED @ attitude.as_matrix() @ FLU_FROM_FRD)
    platform = attitude * from_angles(*np.asarray(mounting_rpy_rad)).inv()
    return Rotation.from_euler("Z", yaw_offset_rad) * platform
