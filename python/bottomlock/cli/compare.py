"""The command `bottomlock compare`: campaigns or variants side by side."""

from pathlib import Path
from typing import Annotated, Any

import polars as pl
from cyclopts import Parameter
from rich.table import Table

from bottomlock.cli.console import console, narrow_table
from bottomlock.cli.force import Force
from bottomlock.errors import OutputError
from bottomlock.pages.numbers import plain
from bottomlock.report.compare import Comparison
from bottomlock.report.compare import compare as lay_side_by_side

SHOWN = (("velocity at the end", ", m/s RMS", 3), ("position at the end", ", m RMS", 1), ("NEES", "", 1))
"""Quantities on the screen, with their units and decimals; the page and the tables have the others."""

COLUMNS = 7
"""Campaigns beside one another in 80 columns."""


def compare(
    *directory: Path,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help="Directory for page, table and figures; that of the variants by default."),
    ] = None,
    against: Annotated[
        str | None, Parameter(help="The campaign that differences are taken to; the first by default.")
    ] = None,
    force: Force = False,
) -> None:
    """Lay campaigns or variants side by side: table, differences, page.

    Writes compare.html, compare.parquet, compare.csv and figures. Differences are paired where the seeds and the
    trajectories are the same.

    Parameters
    ----------
    directory
        Directories of finished campaigns, or one of variants.
    """
    if out is None and len(directory) != 1:
        raise OutputError("--out is missing, expected a directory for page, table and figures")
    folder = directory[0] if out is None else out
    print_comparison(lay_side_by_side(list(directory), folder, against=against, force=force))


def print_comparison(made: Comparison) -> None:
    """Prints the errors at the end, a column for each campaign, and where the page is."""
    labels = made.table["campaign"].unique(maintain_order=True).to_list()
    for number, label in enumerate(labels, start=1):
        words = " (differences are to this one)" if label == made.reference else ""
        console.print(f"{number:>3}  {label}{words}", soft_wrap=True, highlight=False)
    for (trajectory,), rows in made.table.group_by("trajectory", maintain_order=True):
        for quantity, unit, decimals in SHOWN:
            part = rows.filter(rows["quantity"] == quantity)
            for first in range(0, len(labels), COLUMNS):
                title = f"{trajectory}: {quantity}{unit}"
                console.print(
                    _table(part, labels, range(first, min(first + COLUMNS, len(labels))), title, decimals)
                )
    console.print("* differs from the reference: the 95 % interval of the difference excludes zero")
    for trajectory, whys in made.unpaired.items():
        for label, why in whys.items():
            console.print(
                f"not paired with {made.reference}: {label} on {trajectory} ({why})", soft_wrap=True
            )
    console.print(f"wrote {made.page}, compare.parquet, compare.csv and figures", soft_wrap=True)


def _table(rows: pl.DataFrame, labels: list[str], columns: range, title: str, decimals: int) -> Table:
    """A row for each method, a column for each of some campaigns, by their numbers."""
    table = narrow_table(title, ["method"], [str(k + 1) for k in columns])
    cells = {(row["method"], row["campaign"]): row for row in rows.iter_rows(named=True)}
    for method in rows["method"].unique(maintain_order=True):
        table.add_row(method, *(_cell(cells.get((method, labels[k])), decimals) for k in columns))
    return table


def _cell(row: dict[str, Any] | None, decimals: int) -> str:
    """A value, with an asterisk where its difference to the reference is beyond chance."""
    if row is None:
        return "-"
    differs = row["difference"] is not None and not row["difference_lo"] <= 0.0 <= row["difference_hi"]
    return f"{plain(row['value'], digits=4, decimals=decimals)}{'*' if differs else ' '}"
