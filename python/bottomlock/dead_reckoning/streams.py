"""The streams that dead reckoning takes: attitudes and depths with their times."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Depths:
    """Depth below the level of the tangent frame's origin, m, (n,), positive down."""

    time_ns: Times
    depth_m: Floats


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Attitudes of the platform against north, east and down at the vehicle, as recorded, (n,)."""

    time_ns: Times
    attitude: Rotation
