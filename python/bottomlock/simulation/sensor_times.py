"""Measurement times of each sensor."""

import numpy as np
from numpy.typing import NDArray


def epochs_ns(first_ns: int, last_ns: int, rate_hz: float) -> NDArray[np.int64]:
    """Epochs at a rate up to the last time, included; the first comes one interval after the first time.

    >>> epochs_ns(0, 2_000_000_000, 1.0).tolist()
    [1000000000, 2000000000]
    """
    period = 1e9 / rate_hz
    count = int((last_ns - first_ns) / period + 1e-9)
    return first_ns + np.round(np.arange(1, count + 1) * period).astype(np.int64)
