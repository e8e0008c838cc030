"""Campaigns side by side on a terminal."""

from typing import Any

import polars as pl
from rich.table import Table

from bottomlock.cli.console import console, narrow_table, say
from bottomlock.report.compare import Comparison
from bottomlock.text import plain

SHOWN = (("velocity at the end", ", m/s RMS", 3), ("position at the end", ", m RMS", 1), ("NEES", "", 1))
"""Quantities on the screen, with their units and decimals; the page and the table have the others."""

COLUMNS = 7
"""Campaigns beside one another in 80 columns."""


def print_comparison(comparison: Comparison) -> None:
    """Prints the errors at the end, a column for each campaign, and where the page is."""
    labels = comparison.table["campaign"].unique(maintain_order=True).to_list()
    for number, label in enumerate(labels, start=1):
        remark = " (differences are to this one)" if label == comparison.reference else ""
        say(f"{number:>3}  {label}{remark}")
    for (trajectory,), rows in comparison.table.group_by("trajectory", maintain_order=True):
        for quantity, unit, decimals in SHOWN:
            part = rows.filter(rows["quantity"] == quantity)
            for first in range(0, len(labels), COLUMNS):
                here = range(first, min(first + COLUMNS, len(labels)))
                console.print(_table(part, labels, here, f"{trajectory}: {quantity}{unit}", decimals))
    console.print("* differs from the reference: the 95 % interval of the difference excludes zero")
    for trajectory, whys in comparison.unpaired.items():
        for label, why in whys.items():
            say(f"not paired with {comparison.reference}: {label} on {trajectory} ({why})")
    if comparison.page is not None:
        say(f"wrote {comparison.page} and compare.parquet")


def _table(rows: pl.DataFrame, labels: list[str], columns: range, title: str, decimals: int) -> Table:
    """A row for each method, a column for each of some campaigns, by their numbers."""
    cells = {(row["method"], row["campaign"]): row for row in rows.iter_rows(named=True)}
    shown = [
        [method, *(_cell(cells.get((method, labels[k])), decimals) for k in columns)]
        for method in rows["method"].unique(maintain_order=True)
    ]
    return narrow_table(title, ["method", *(str(k + 1) for k in columns)], shown)


def _cell(row: dict[str, Any] | None, decimals: int) -> str:
    """A value, with an asterisk where its difference to the reference is beyond chance."""
    if row is None:
        return "-"
    differs = row["difference"] is not None and not row["difference_lo"] <= 0.0 <= row["difference_hi"]
    return f"{plain(row['value'], digits=4, decimals=decimals)}{'*' if differs else ' '}"
