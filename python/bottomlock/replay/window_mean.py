"""Means of readings over a window, with their standard deviation from the scatter of block means."""

from dataclasses import dataclass

import numpy as np

from bottomlock.errors import DataError
from bottomlock.recordings.streams import Floats

BLOCKS = 10
"""Number of blocks of a window: scatter slower than the sampling then still counts."""


@dataclass(frozen=True, eq=False)
class Mean:
    """Mean (3,) and its standard deviation (3,)."""

    value: Floats
    sd: Floats


def mean_over(values: Floats, section: str, window_s: float) -> Mean:
    """Mean of (n, 3) readings and its standard deviation from the scatter of the means of ten blocks.

    Raises:
        DataError: for fewer readings than blocks.
    """
    if len(values) < BLOCKS:
        raise DataError(
            f"[{section}] has {len(values)} rows in the {window_s:g} s before the start",
            expected=f"{BLOCKS} or more",
            hint="lengthen start.window_s or set a later start.at_s",
        )
    return Mean(values.mean(axis=0), scatter_of_mean(values))


def scatter_of_mean(values: Floats) -> Floats:
    """(3,) standard deviation of the mean, from the means of ten consecutive blocks.

    Readings of a vehicle in waves are correlated; means over a tenth of the window are nearly independent.

    >>> scatter_of_mean(np.tile([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], (50, 1))).tolist()
    [0.0, 0.0, 0.0]
    """
    blocks = np.stack([block.mean(axis=0) for block in np.array_split(values, BLOCKS)])
    return np.asarray(blocks.std(axis=0, ddof=1) / np.sqrt(BLOCKS))
