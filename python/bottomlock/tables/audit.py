"""Tables of an audit: column names, types, meanings."""

from collections.abc import Mapping

import polars as pl

FINDINGS: Mapping[str, pl.DataType] = {
    "rank": pl.Int64(),
    "kind": pl.String(),
    "severity": pl.String(),
    "beams": pl.List(pl.Int64()),
    "size": pl.Float64(),
    "unit": pl.String(),
    "fraction": pl.Float64(),
    "text": pl.String(),
    "evidence": pl.String(),
    "hint": pl.String(),
    "place": pl.String(),
    "expected": pl.String(),
}
