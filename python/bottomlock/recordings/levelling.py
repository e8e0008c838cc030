"""Roll and pitch from the direction of gravity, for a replay and live."""

import numpy as np
from numpy.typing import NDArray


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
