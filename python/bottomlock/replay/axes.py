"""Turning readings into platform axes, and attitudes between people's angles and machines' quaternions."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from bottomlock.replay.stream_sections import Axes

Floats = NDArray[np.float64]

_ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Its own inverse: the same matrix takes east–north–up to north–east–down."""
_FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])


def flip(values: Floats, axes: Axes) -> Floats:
    """(n, 3) readings along the platform's axes: `axes` names the sensor's axis, with its sign, for each of them.

    >>> flip(np.array([[1.0, 2.0, 3.0]]), ("x", "-y", "z")).tolist()
    [[1.0, -2.0, 3.0]]
    """
    columns = [("xyz".index(axis[-1]), -1.0 if axis.startswith("-") else 1.0) for axis in axes]
    return np.stack([sign * values[:, column] for column, sign in columns], axis=1)


def handedness(axes: Axes) -> int:
    """+1 where the sensor's axes are right-handed, as the platform's are, −1 where they are not."""
    return round(float(np.linalg.det(flip(np.eye(3), axes))))


def from_angles(roll_rad: ArrayLike, pitch_rad: ArrayLike, yaw_rad: ArrayLike) -> Rotation:
    """Rotations that take platform vectors to the tangent frame, from Euler angles z-y-x."""
    angles = np.stack(np.broadcast_arrays(yaw_rad, pitch_rad, roll_rad), axis=-1)
    return Rotation.from_euler("ZYX", angles)


def to_angles(attitude: Rotation) -> Floats:
    """(..., 3) roll, pitch, yaw, rad."""
    return np.asarray(attitude.as_euler("ZYX")[..., ::-1])


def quaternions(attitude: Rotation) -> Floats:
    """(..., 4), scalar first; scipy keeps the scalar last."""
    return np.ascontiguousarray(np.roll(attitude.as_quat(), 1, axis=-1))


def from_quaternions(attitude_t_p: ArrayLike) -> Rotation:
    """Rotations from (..., 4) quaternions, scalar first."""
    return Rotation.from_quat(np.roll(np.asarray(attitude_t_p, dtype=np.float64), -1, axis=-1))


def mounted(values: Floats, axes: Axes, mounting_rpy_rad: ArrayLike) -> Floats:
    """(n, 3) readings in platform axes: flipped, then turned by the mounting (sensor to platform)."""
    return np.asarray(from_angles(*np.asarray(mounting_rpy_rad)).apply(flip(values, axes)))


def platform_attitude(
    attitude: Rotation, frame: str, mounting_rpy_rad: ArrayLike, yaw_offset_rad: float
) -> Rotation:
    """Attitudes of the platform from those of a sensor on it.

    Args:
        attitude: of the sensor, as its angles say.
        frame: "ned_frd", or "enu_flu": angles z-y-x from east–north–up to forward–left–up.
        mounting_rpy_rad: (3,) turns sensor axes to platform axes.
        yaw_offset_rad: added to the yaw, about the vertical.
    """
    if frame == "enu_flu":
        attitude = Rotation.from_matrix(_ENU_FROM_NED @ attitude.as_matrix() @ _FLU_FROM_FRD)
    turned = attitude * from_angles(*np.asarray(mounting_rpy_rad)).inv()
    return Rotation.from_euler("Z", yaw_offset_rad) * turned
