"""The command `bottomlock observe`: what can be estimated along a scenario, or in the 2015 paper's cases."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import polars as pl
from cyclopts import Parameter
from rich.table import Table

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, narrow_table, say
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


def _rank(row: dict[str, Any]) -> str:
    return "?" if row["rank"] is None else str(row["rank"])


def _cases(rows: pl.DataFrame) -> Table:
    """A block of rows per case: what is printed, then each window and sign of H."""
    cells, last = [], None
    for row in rows.iter_rows(named=True):
        if row["case"] != last:
            cells.append([row["case"], str(row["printed_rank"]), "", "", "", ""])
            last = row["case"]
        motion = "  " + row["motion"] + row["model"].removeprefix("2015")
        verdict = row["verdict"].removesuffix(" than printed")
        cells.append([motion, "", str(row["expected_rank"]), _rank(row), f"{row['gap']:.0e}", verdict])
    return narrow_table("", ["case", "printed", "exact", "computed", "gap", "verdict"], cells)


def _masks(rows: pl.DataFrame, own: str) -> Table:
    cells = [
        [
            row["aiding"] + ("  < this scenario" if row["aiding"] == own else ""),
            _rank(row), str(row["states"]), f"{row['gap']:.0e}",
        ]
        for row in rows.iter_rows(named=True)
    ]  # fmt: skip
    return narrow_table("", ["aiding", "rank", "of", "gap"], cells)


def _ranking(rows: pl.DataFrame) -> Table:
    names = rows["manoeuvre"].unique(maintain_order=True).to_list()
    cells = [
        [
            str(state),
            *(
                ("-" if part is None else f"{100.0 * part:.0f}") + _SIGNS[verdict]
                for part, verdict in of_state.select("fraction_left", "verdict").iter_rows()
            ),
        ]
        for (state,), of_state in rows.group_by("state", maintain_order=True)
    ]
    return narrow_table("", ["state", *(name.replace("_", "\n") for name in names)], cells)


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
