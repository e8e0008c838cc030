"""The table of the paper's claims: column names, types, meanings."""

from collections.abc import Mapping

import polars as pl

CLAIMS: Mapping[str, pl.DataType] = {
    "claim": pl.String(),
    "trajectory": pl.String(),
    "quantity": pl.String(),
    "paper": pl.Float64(),
    "ours": pl.Float64(),
    "lo": pl.Float64(),
    "hi": pl.Float64(),
    "verdict": pl.String(),
    "note": pl.String(),
}
"""A row per claim of the paper: the printed number (null where it prints an ordering), ours with its 95 % bootstrap
interval (null where it cannot be tested), the verdict and what was measured about it."""
