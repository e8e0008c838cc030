"""A table held against its columns."""

from collections.abc import Mapping

import polars as pl

from bottomlock.errors import bad_column


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
            raise bad_column(place, name, "is missing", ", ".join(columns))
        if frame.schema[name] != dtype:
            raise bad_column(place, name, f"is {frame.schema[name]}", dtype)
    extra = [name for name in frame.columns if name not in columns]
    if extra:
        raise bad_column(place, extra[0], "is unknown", ", ".join(columns))
    return frame.select(list(columns))
