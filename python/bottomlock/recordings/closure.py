"""Closure of redundant beams: combinations of their readings to which no velocity contributes, of noise alone."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

SMALLEST = 1e-9
"""Of the largest singular value: below it, a direction is none."""


def closure_rows(directions_p: ArrayLike) -> NDArray[np.float64]:
    """(B − rank, B) orthonormal combinations n with n · A v = 0 for every v, A the (B, 3) directions of the beams.

    There are none for three independent beams or fewer. The first component of each is not negative.

    Examples:
        The four beams of a Janus have one, with alternating signs and unit length, so that its value scatters as one
        beam:

        >>> from bottomlock.kernel import BeamGeometry
        >>> closure_rows(BeamGeometry.janus(0.35).directions_p).round(3).tolist()
        [[0.5, -0.5, 0.5, -0.5]]
    """
    directions = np.asarray(directions_p, dtype=np.float64)
    if not len(directions):
        return np.zeros((0, 0))
    left, values, _ = np.linalg.svd(directions)
    null = left[:, int((values > SMALLEST * values[0]).sum()) :].T
    # The sign of a singular vector is arbitrary.
    signs = np.where(null[:, :1] < 0.0, -1.0, 1.0)
    return np.ascontiguousarray(null * signs)
