"""Root mean square: the one definition, for arrays and for columns, with its bootstrap over runs.

Every RMS of this package comes from here. Where runs are resampled or chunks are combined, what is passed on is the
mean square of each run or chunk, and the root is taken last.
"""

from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np
import polars as pl
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

BOOTSTRAP_RESAMPLES = 1000
BOOTSTRAP_SEED = 20170222
INTERVAL_PERCENT = (2.5, 97.5)
"""Percentiles of the resamples that bound the 95 % interval."""

WEIGHTS_HELD = 8_000_000
"""Bootstrap weights in memory at a time, 64 MB: up to 8,000 runs they are drawn at once."""


def mean_square(values: ArrayLike, axis: int | tuple[int, ...] | None = None) -> Array:
    """Mean of the squares over some axes, or over all values."""
    return np.asarray(np.mean(np.asarray(values, dtype=np.float64) ** 2, axis=axis))


def rms(values: ArrayLike, axis: int | tuple[int, ...] | None = None) -> Array:
    """Root mean square over some axes, or over all values.

    >>> float(rms([3.0, 4.0])) ** 2
    12.5
    """
    return np.asarray(np.sqrt(mean_square(values, axis)))


def rms_column(column: str) -> pl.Expr:
    """Root mean square of a column, as an expression; nulls are left out.

    >>> pl.DataFrame({"x": [1.0, 7.0]}).select(rms_column("x")).item()
    5.0
    """
    return root_mean(pl.col(column) ** 2)


def root_mean(squares: pl.Expr) -> pl.Expr:
    """Root mean square from an expression of squares; nulls are left out."""
    return squares.mean().sqrt()


def combined_rms(mean_squares: Array, weights: Array | None = None) -> Array:
    """Root mean square over groups of values from the mean square of each.

    Args:
        mean_squares: (groups, ...); the groups are runs, or chunks of runs.
        weights: (groups,) or (resamples, groups), each row with the sum 1; None weighs all groups alike.

    Returns:
        (...), or (resamples, ...) with a row of weights per resample.
    """
    if weights is None:
        return np.asarray(np.sqrt(np.mean(mean_squares, axis=0)))
    flat = mean_squares if mean_squares.ndim == 1 else mean_squares.reshape(len(mean_squares), -1)
    return np.reshape(np.sqrt(weights @ flat), (*weights.shape[:-1], *mean_squares.shape[1:]))


def bootstrap_weights(runs: int, *key: int) -> Array:
    """(resamples, runs) how often each resample of whole runs draws each run, as fractions of 1.

    The weights depend on the number of runs and the key alone: methods that share them stay paired.
    """
    return np.concatenate(list(_draw_weights(runs, *key)))


def bootstrap_rms(squares: Array) -> tuple[Array, Array]:
    """95 % bootstrap interval of the RMS over runs, at each time.

    Whole runs are drawn, so that the times of a run stay together. The interval depends on nothing but the data.

    Args:
        squares: (runs, times) squared errors.

    Returns:
        Lower and upper bound, (times,) each.

    Examples:
        >>> low, high = bootstrap_rms(np.ones((5, 2)))
        >>> low.tolist(), high.tolist()
        ([1.0, 1.0], [1.0, 1.0])
    """
    drawn = np.sqrt(np.concatenate([squares.T @ weights.T for weights in _weights(squares.shape[0])], axis=1))
    # Times are rows, which numpy sorts fast; it partitions sorted rows faster than unsorted ones.
    drawn.sort(axis=1)
    low, high = np.percentile(drawn, INTERVAL_PERCENT, axis=1)
    return low, high


def _weights(runs: int) -> Iterable[Array]:
    """Weights of whole runs (resamples, runs), in blocks that memory can hold."""
    return _few_weights(runs) if BOOTSTRAP_RESAMPLES * runs <= WEIGHTS_HELD else _draw_weights(runs)


@lru_cache(maxsize=1)
def _few_weights(runs: int) -> list[Array]:
    """Every method and quantity of a campaign has the same ones."""
    return list(_draw_weights(runs))


def _draw_weights(runs: int, *key: int) -> Iterator[Array]:
    generator = np.random.default_rng([BOOTSTRAP_SEED, *key])
    at_once = max(1, WEIGHTS_HELD // runs)
    # One generator over all blocks: the draws are those of a single call.
    for first in range(0, BOOTSTRAP_RESAMPLES, at_once):
        size = min(at_once, BOOTSTRAP_RESAMPLES - first)
        yield generator.multinomial(runs, np.full(runs, 1.0 / runs), size=size) / runs
