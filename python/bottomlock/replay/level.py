"""North, east and down at the places of a recording."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from bottomlock.kernel import local_earth
from bottomlock.kernel.models import Environment


def level_axes(environment: Environment, position_t_m: ArrayLike) -> Rotation:
    """(n,) rotations from north, east and down at positions (n, 3), m, to the tangent frame."""
    position = np.nan_to_num(np.asarray(position_t_m, dtype=np.float64))
    if environment.earth == "tangent_plane":
        return Rotation.identity(len(position))
    return Rotation.from_matrix(local_earth(environment, position)["rotation_t_n"])
