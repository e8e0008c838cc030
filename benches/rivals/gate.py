"""Chi-squared tests of innovations, each row by itself; the probability is that of the mission's options."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from bottomlock.kernel.models import Options

Floats = NDArray[np.float64]


class Gate:
    """Passes a row unless its innovation squared over its variance is beyond the quantile.

    A sensor whose last five measurements were rejected as a whole is let in, so that no filter is locked out for ever.
    """

    REJECTIONS = 5

    def __init__(self, options: Options) -> None:
        self.threshold = np.inf if options.gate == "off" else float(chi2.ppf(options.gate_probability, 1))
        self.rejected: dict[str, int] = {}

    def passes(self, kind: str, innovation: Floats, variance: Floats) -> NDArray[np.bool_]:
        """Which rows are used, (m,)."""
        keep: NDArray[np.bool_] = innovation**2 <= self.threshold * variance
        if keep.any():
            self.rejected[kind] = 0
            return keep
        self.rejected[kind] = self.rejected.get(kind, 0) + 1
        return np.full(len(innovation), self.rejected[kind] > self.REJECTIONS)
