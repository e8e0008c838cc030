"""Robust standard deviations: 1.4826 times a median, which is the standard deviation of Gaussian values."""

import math
from typing import Any

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


def white_sd(values: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """(k,) 1 sigma of the white noise of values (n, k), by differences of an order, which leave out what is smooth.

    Of white noise they have the variance of the central binomial coefficient, C(2 order, order), times its own.

    >>> noise = np.random.default_rng(1).normal(size=(5000, 1))
    >>> [white_sd(noise + np.linspace(0.0, 50.0, 5000)[:, None], order).round(1).item() for order in (1, 2, 3)]
    [1.0, 1.0, 1.0]
    """
    sd = sd_about_median(np.diff(values, order, axis=0), axis=0)
    return np.asarray(sd / np.sqrt(math.comb(2 * order, order)))


Array = NDArray[np.floating[Any]]


def correlation_rows(values: Array, *, centred: bool = True) -> float:
    """Integrated autocorrelation time of values (n,) or (n, k), in rows, the longest of the columns; 1 if independent.

    The mean of n values has the variance of n / this independent ones. Summed up to five times itself (Sokal 1997).

    Args:
        values: one row after the other in time, evenly.
        centred: about the mean; False is about zero, for errors whose expectation is zero, where an offset that stays
            is one value, however many rows have it.

    >>> white = np.random.default_rng(1).normal(size=4000)
    >>> round(correlation_rows(white)), 8 < correlation_rows(np.repeat(white, 10)) < 12
    (1, True)
    """
    columns = values.reshape(len(values), -1)
    count, longest = len(columns), 1.0
    if count < 8:
        return longest
    reach = count // 4
    lags = np.arange(1, reach)
    for column in columns.T:
        spectrum = np.fft.rfft(column - column.mean() if centred else column, 2 * count)
        acf = np.fft.irfft(np.abs(spectrum) ** 2)[:reach]
        if acf[0] <= 0.0:
            continue
        summed = 1.0 + 2.0 * np.cumsum(acf[1:] / acf[0])
        stop = np.flatnonzero(lags >= 5.0 * summed)
        # The largest sum up to there: beyond the correlation a sum wanders, and too short a time claims too much.
        longest = max(longest, float(summed[: stop[0] + 1 if stop.size else None].max()))
    return longest


BLOCKS, PER_BLOCK = 50, 2
"""Largest number of blocks of consecutive rows, and correlation times in one. The variance of the mean of AR(1) noise
is then a fraction 1 / (2 × 2) too small at most, which the thresholds allow for."""


def blocks_of(rows: int, correlated: float = 1.0) -> NDArray[np.int64]:
    """(rows,) block number of each row: `BLOCKS` blocks of consecutive rows, fewer where they would be too short.

    A block has two rows and `PER_BLOCK` correlation times at least.

    >>> blocks_of(6).tolist(), int(blocks_of(400, 10.0)[-1])
    ([0, 0, 1, 1, 2, 2], 19)
    """
    least = max(2, int(np.ceil(PER_BLOCK * correlated)) if correlated > 1.5 else 2)
    count = max(1, min(BLOCKS, rows // least))
    return np.asarray(np.arange(rows) * count // max(rows, 1), dtype=np.int64)


def correlation_blocks(scores: Array) -> NDArray[np.int64]:
    """(n,) block number of each row of scores (n, k), which may be correlated from one to the next."""
    return blocks_of(len(scores), correlation_rows(scores))
