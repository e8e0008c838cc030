"""Robust standard deviations: 1.4826 times a median, which is the standard deviation of Gaussian values."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

GAUSSIAN = 1.4826
"""Standard deviation of Gaussian values over the median of their magnitudes, 1 / 0.6745."""


def sd_about_zero(values: ArrayLike, *, axis: int | None = None) -> NDArray[np.float64]:
    """1.4826 times the median magnitude, over all values or along an axis, in the unit of the values; NaN for none.

    >>> float(sd_about_zero([-1.0, 0.5, 2.0, 1e9]).round(3))
    2.224
    """
    size = np.abs(np.asarray(values, dtype=np.float64))
    if not size.size:
        return np.full(() if axis is None else np.delete(size.shape, axis), np.nan)
    return np.asarray(GAUSSIAN * np.median(size, axis=axis))


def sd_about_median(values: ArrayLike, *, axis: int | None = None) -> NDArray[np.float64]:
    """1.4826 times the median deviation from the median, as `sd_about_zero`.

    >>> float(sd_about_median([0.0, 1.0, 2.0, 3.0, 1e9]))
    1.4826
    """
    numbers = np.asarray(values, dtype=np.float64)
    if not numbers.size:
        return sd_about_zero(numbers, axis=axis)
    return sd_about_zero(numbers - np.median(numbers, axis=axis, keepdims=True), axis=axis)
