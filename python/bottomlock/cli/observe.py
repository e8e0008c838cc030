"""The command `bottomlock observe`: what can be estimated along a scenario, or in the 2015 paper's cases."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import polars as pl
from cyclopts import Parameter
from rich import box
from rich.table import Table

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, say
from bottomlock.cli.parameters import beside
from bottomlock.errors import ScenarioError
from bottomlock.observability.report import Observed, observe_paper, observe_scenario

_SIGNS = {"observable": "", "unobservable": "*", "undecided": "?"}


def console_lines(made: Observed) -> Iterator[str | Table]:
    """Lines and tables, in the order in which they are read."""
    if made.own is None or made.manoeuvres is None:
        yield _cases(made.table)
        return
    yield "Rank by the beams that return (? is undecided)."
    yield _masks(made.table, made.own)
    yield f"Unobservable with {made.own}, SI:"
    for direction in made.table.filter(aiding=made.own)["unobservable"].explode().drop_nulls():
        yield f"  {direction}"
    yield ""
    yield f"Deviation left by a manoeuvre of about a minute with {made.manoeuvres['aiding'][0]}, % of the initial"
    yield "(* the state is unobservable, ? undecided)."
    yield _ranking(made.manoeuvres)


def _plain(left: str, *right: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column(left)
    for name in right:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _rank(row: dict[str, Any]) -> str:
    return "?" if row["rank"] is None else str(row["rank"])


def _cases(rows: pl.DataFrame) -> Table:
    """A block of rows per case: what is printed, then each window and sign of H."""
    table = _plain("case", "printed", "exact", "computed", "gap", "verdict")
    last = None
    for row in rows.iter_rows(named=True):
        if row["case"] != last:
            table.add_row(row["case"], str(row["printed_rank"]), "", "", "", "")
            last = row["case"]
        table.add_row(
            "  " + row["motion"] + row["model"].removeprefix("2015"),
            "",
            str(row["expected_rank"]),
            _rank(row),
            f"{row['gap']:.0e}",
            row["verdict"].removesuffix(" than printed"),
        )
    return table


def _masks(rows: pl.DataFrame, own: str) -> Table:
    table = _plain("aiding", "rank", "of", "gap")
    for row in rows.iter_rows(named=True):
        mark = "  < this scenario" if row["aiding"] == own else ""
        table.add_row(row["aiding"] + mark, _rank(row), str(row["states"]), f"{row['gap']:.0e}")
    return table


def _ranking(rows: pl.DataFrame) -> Table:
    names = rows["manoeuvre"].unique(maintain_order=True).to_list()
    table = _plain("state", *(name.replace("_", "\n") for name in names))
    for (state,), of_state in rows.group_by("state", maintain_order=True):
        cells = (
            ("-" if part is None else f"{100.0 * part:.0f}") + _SIGNS[verdict]
            for part, verdict in of_state.select("fraction_left", "verdict").iter_rows()
        )
        table.add_row(str(state), *cells)
    return table


def observe(
    scenario: str | None = None,
    *,
    out: Annotated[Path | None, Parameter(alias="-o")] = None,
    paper: bool = False,
    force: Force = False,
) -> None:
    """Analyse which states can be estimated, and which manoeuvre helps.

    For every set of beams of a scenario's instrument, along its truth.

    Args:
        scenario: Packaged scenario (see `bottomlock list scenarios`) or TOML file.
        out: Directory for tables and figures; SCENARIO_states or paper_states by default.
        paper: Analyse the six cases of Klein & Diamant 2015 in place of a scenario.
    """
    if paper == (scenario is not None):
        raise ScenarioError(expected="either a scenario or --paper")
    out = out or beside(Path(scenario or "paper"), "states")
    made = (
        observe_paper(out, force=force) if scenario is None else observe_scenario(scenario, out, force=force)
    )
    for part in console_lines(made):
        console.print(part, highlight=False)
    say(f"wrote {'a table' if scenario is None else 'tables and a figure'} to {out}")
