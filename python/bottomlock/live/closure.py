"""Do the beams agree with one another as well as their noise claims? The closure of the last complete pings.

More than three beams are redundant: the combinations that no velocity causes hold noise alone. The median of many keeps
single outliers out, which the gate judges.
"""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beams import Instrument
from bottomlock.recordings.closure import closure_rows

PINGS = 20
"""Complete pings that are judged together."""
_GAUSSIAN = 0.6745
"""Median of |z| of a standard normal z."""


def whitened_closure(instrument: Instrument) -> NDArray[np.float64]:
    """(k, n) combinations of the readings over their claimed noise that no velocity causes, each of variance 1."""
    whitened = instrument.geometry.directions_p / instrument.beam_sd_mps[:, np.newaxis]
    return closure_rows(whitened)


class Closure:
    """Scatter of the closure over what the noise of the beams claims.

    Args:
        instrument: geometry and claimed noise.

    Attributes:
        ratio: robust, over the last `PINGS` complete pings; None before there are so many, and with three beams. With
            Gaussian noise as claimed it exceeds 3 once in 400 million sets of pings.

    Examples:
        >>> from bottomlock.io.beams import read_geometry
        >>> closure = Closure(read_geometry("waterlinked_a50"))  # claims 4 mm/s
        >>> for sign in [1.0, -1.0] * 10: closure.add(sign * np.array([0.08, 0.0, 0.0, 0.0]), np.ones(4, dtype=bool))
        >>> round(closure.ratio)
        15
    """

    def __init__(self, instrument: Instrument) -> None:
        self._sd_mps = instrument.beam_sd_mps
        self._rows = whitened_closure(instrument)
        self._last: deque[NDArray[np.float64]] = deque(maxlen=PINGS)
        self.ratio: float | None = None

    def add(self, velocity_mps: NDArray[np.float64], valid: NDArray[np.bool_]) -> None:
        """Takes a ping: velocities along the beams (n,) and which are valid (n,)."""
        if not self._rows.size or not valid.all():
            return
        self._last.append(self._rows @ (velocity_mps / self._sd_mps))
        if len(self._last) == PINGS:
            self.ratio = float(np.median(np.abs(self._last)) / _GAUSSIAN)
