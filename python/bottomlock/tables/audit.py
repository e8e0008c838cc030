"""Tables of an audit: column names, types, meanings."""

import polars as pl

from bottomlock.tables.schema import Schema, schema

FINDINGS: Schema = schema(
    "rank: int",
    "kind severity: text",
    {"beams": pl.List(pl.Int64())},
    "size sd: float",
    "unit: text",
    "fraction: float",
    "text evidence hint place expected: text",
)
