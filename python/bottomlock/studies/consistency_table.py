"""What the verdicts of a consistency study amount to: cells and methods."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from bottomlock.statistics.chi_squared import CONSERVATIVE, CONSISTENT, OVERCONFIDENT
from bottomlock.tables.studies import QUANTITIES

_SUFFIX = {CONSISTENT: "consistent", OVERCONFIDENT: "overconfident", CONSERVATIVE: "conservative"}
MARKS = {CONSISTENT: "", OVERCONFIDENT: " ▲", CONSERVATIVE: " ▽"}


def consistent_cells(table: pl.DataFrame) -> pl.DataFrame:
    """A row per method, trajectory and mask with `consistent`.

    It is where the NEES of velocity and attitude is consistent and no quantity is overconfident.
    """
    core = (pl.col("quantity") == "nees_velocity_attitude") & (pl.col("verdict") != CONSISTENT)
    return table.group_by("method", "trajectory", "beams", maintain_order=True).agg(
        (~(core.any() | (pl.col("verdict") == OVERCONFIDENT).any())).alias("consistent")
    )


def methods_summary(table: pl.DataFrame) -> pl.DataFrame:
    """A row per method: cells (trajectory and mask), those consistent, and the verdicts by quantity.

    Columns: method, cells, consistent, and for each quantity Q: Q_consistent, Q_overconfident, Q_conservative.
    """
    summary = (
        consistent_cells(table)
        .group_by("method", maintain_order=True)
        .agg(pl.len().alias("cells"), pl.col("consistent").sum())
    )
    counts = [
        ((pl.col("quantity") == quantity) & (pl.col("verdict") == verdict))
        .sum()
        .alias(f"{quantity}_{suffix}")
        for quantity in QUANTITIES
        for verdict, suffix in _SUFFIX.items()
    ]
    return summary.join(table.group_by("method").agg(counts), on="method", how="left", maintain_order="left")


def counts_of(row: Mapping[str, Any]) -> list[str]:
    """`consistent / overconfident / conservative` for each quantity, from a row of `methods_summary`."""
    return [
        " / ".join(str(row[f"{quantity}_{suffix}"]) for suffix in _SUFFIX.values()) for quantity in QUANTITIES
    ]


def decisive(row: Mapping[str, Any]) -> float:
    """The mean that decides a verdict: the greatest or least where it is outside, else the mean over the times."""
    name = {OVERCONFIDENT: "greatest", CONSERVATIVE: "least"}.get(row["verdict"], "mean")
    return float(row[name])
