"""A table held against its columns."""

from collections.abc import Mapping

import polars as pl

from bottomlock.errors import DataError


def check(frame: pl.DataFrame, columns: Mapping[str, pl.DataType], *, place: str) -> pl.DataFrame:
    """The frame itself, if it has exactly these columns in this order and of these types.

    Raises:
        DataError: naming the place, the column and what was expected.

    Examples:
        >>> check(pl.DataFrame({"run": [1]}), {"run": pl.Int64()}, place="runs.parquet").shape
        (1, 1)
    """
    for name, dtype in columns.items():
        if name not in frame.columns:
            raise DataError("is missing", place=place, key=f"column '{name}'", expected=", ".join(columns))
        if frame.schema[name] != dtype:
            raise DataError(f"is {frame.schema[name]}", place=place, key=f"column '{name}'", expected=dtype)
    extra = [name for name in frame.columns if name not in columns]
    if extra:
        raise DataError("is unknown", place=place, key=f"column '{extra[0]}'", expected=", ".join(columns))
    return frame.select(list(columns))
