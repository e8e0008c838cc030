"""The command `bottomlock observe`: what can be estimated along a scenario, or in the 2015 paper's cases."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, narrow_table, say
from bottomlock.cli.parameters import Out, beside
from bottomlock.errors import ScenarioError

if TYPE_CHECKING:
    import polars as pl
    from rich.table import Table

    from bottomlock.observability.report import Observed

_SIGNS = {"observable": "", "unobservable": "*", "undecided": "?"}


def console_lines(observed: Observed) -> Iterator[str | Table]:
    """Lines and tables, in the order in which they are read."""
    if observed.own is None or observed.manoeuvres is None:
        yield _cases(observed.table)
        return
    yield "Rank by the beams that return (? is undecided)."
    yield _masks(observed.table, observed.own)
    yield f"Unobservable with {observed.own}, SI:"
    for direction in observed.table.filter(aiding=observed.own)["unobservable"].explode().drop_nulls():
        yield f"  {direction}"
    yield ""
    yield f"Deviation left by a manoeuvre of about a minute with {observed.manoeuvres['aiding'][0]}, % of the initial"
    yield "(* the state is unobservable, ? undecided)."
    yield _ranking(observed.manoeuvres)


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


def _masks(rows: pl.DataFrame, aiding: str) -> Table:
    cells = [
        [
            row["aiding"] + ("  < this scenario" if row["aiding"] == aiding else ""),
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
    out: Out = None,
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
    from bottomlock.observability.report import observe_paper, observe_scenario

    if paper == (scenario is not None):
        raise ScenarioError(expected="either a scenario or --paper")
    out = out or beside(Path(scenario or "paper"), "states")
    observed = (
        observe_paper(out, force=force) if scenario is None else observe_scenario(scenario, out, force=force)
    )
    for part in console_lines(observed):
        console.print(part, highlight=False)
    say(f"wrote {'a table' if scenario is None else 'tables and a figure'} to {out}")
