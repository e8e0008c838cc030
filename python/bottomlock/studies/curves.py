"""Columns of a study by method, as curves over its categories."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray


def by_method(
    rows: pl.DataFrame, key: str, categories: Sequence[str], column: str
) -> dict[str, NDArray[np.float64]]:
    """The column by method, in the order of the categories; NaN where a method has none."""
    found = {}
    for (method,), part in rows.group_by("method", maintain_order=True):
        values = dict(zip(part[key], part[column], strict=True))
        found[str(method)] = np.array([values.get(one, np.nan) for one in categories], dtype=np.float64)
    return found
