"""The points that a figure draws, and how many of them are in a table."""

import numpy as np
import polars as pl
from matplotlib.axes import Axes


def points(axes: Axes) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """(n, 2) the points of every line in data coordinates."""
    lines = [
        np.column_stack([np.asarray(one.get_xdata(), dtype=float), np.asarray(one.get_ydata(), dtype=float)])
        for one in axes.lines
        if one.get_transform() == axes.transData
    ]
    every = np.concatenate(lines)
    return np.asarray(every[np.isfinite(every).all(axis=1)])


def held(shown: np.ndarray[tuple[int, int], np.dtype[np.float64]], x: pl.Series, y: pl.Series) -> float:
    """The fraction of points that are among others."""
    known = set(zip(x.to_list(), y.to_list(), strict=True))
    return float(np.mean([(one[0], one[1]) in known for one in shown.tolist()]))
