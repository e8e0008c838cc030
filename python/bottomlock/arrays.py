"""Helpers on arrays that every room may use."""

import numpy as np
from numpy.typing import NDArray


def rising(time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of the times (n,) are later than all before them; the first one is.

    >>> rising(np.array([1, 3, 3, 2, 4])).tolist()
    [True, True, False, False, True]
    """
    rises = np.ones(len(time_ns), dtype=bool)
    rises[1:] = time_ns[1:] > np.maximum.accumulate(time_ns)[:-1]
    return rises
