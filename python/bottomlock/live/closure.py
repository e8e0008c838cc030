"""Do the beams agree with one another as well as their noise claims? The closure of the last complete pings.

More than three beams are redundant: the combinations that no velocity causes hold noise alone. The median of many keeps
single outliers out, which the gate judges.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.closure import closure_rows

PINGS = 20
"""Complete pings that are judged together."""
_GAUSSIAN = 0.6745
"""Median of |z| of a standard normal z."""


def whitened_closure(geometry: BeamGeometry, sd_mps: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, n) combinations of the readings over their claimed noise that no velocity causes, each of variance 1."""
    return closure_rows(geometry.directions_p / sd_mps[:, np.newaxis])


class Closure:
    """Scatter of the closure over what the noise of the beams claims.

    Args:
        geometry: the beams.

    Attributes:
        ratio: robust, over the last `PINGS` complete pings; None before there are so many, and with three beams. With
            Gaussian noise as claimed it exceeds 3 once in 400 million sets of pings.

    Examples:
        >>> from bottomlock.io.beams import read_geometry
        >>> a50 = read_geometry("waterlinked_a50")  # claims 4 mm/s
        >>> closure, one, valid = Closure(a50.geometry), np.array([0.08, 0.0, 0.0, 0.0]), np.ones(4, dtype=bool)
        >>> for sign in [1.0, -1.0] * 10: closure.add(sign * one, valid, a50.beam_sd_mps)
        >>> round(closure.ratio)
        15
    """

    def __init__(self, geometry: BeamGeometry) -> None:
        self._geometry = geometry
        self._last: deque[NDArray[np.float64]] = deque(maxlen=PINGS)
        self.ratio: float | None = None

    def add(
        self, velocity_mps: NDArray[np.float64], valid: NDArray[np.bool_], sd_mps: NDArray[np.float64]
    ) -> None:
        """Takes a ping: velocities along the beams (n,), which are valid (n,), and their claimed noise (n,)."""
        if not valid.all():
            return
        rows = whitened_closure(self._geometry, sd_mps)
        if not rows.size:
            return
        self._last.append(rows @ (velocity_mps / sd_mps))
        if len(self._last) == PINGS:
            self.ratio = float(np.median(np.abs(self._last)) / _GAUSSIAN)
