"""Columns of a table: their names and types, in order."""

from collections.abc import Mapping

import polars as pl

Schema = Mapping[str, pl.DataType]

_TYPES: Schema = {
    "text": pl.String(), "int": pl.Int64(), "float": pl.Float64(), "single": pl.Float32(), "flag": pl.Boolean(),
}  # fmt: skip


def schema(*parts: str | Schema) -> dict[str, pl.DataType]:
    """Columns in their order: names of one type, which stands behind a colon, or columns that are made already.

    >>> schema("run: int", "north_m east_m: float", {"beams": pl.List(pl.Int64())})
    {'run': Int64, 'north_m': Float64, 'east_m': Float64, 'beams': List(Int64)}
    """
    columns: dict[str, pl.DataType] = {}
    for part in parts:
        if isinstance(part, str):
            names, kind = part.split(":")
            columns |= dict.fromkeys(names.split(), _TYPES[kind.strip()])
        else:
            columns |= part
    return columns
