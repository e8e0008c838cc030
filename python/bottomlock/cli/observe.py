"""The command `bottomlock observe`: what can be estimated along a scenario, or in the 2015 paper's cases."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from bottomlock.cli.console import console
from bottomlock.cli.force import Force
from bottomlock.cli.parameters import beside
from bottomlock.errors import ScenarioError
from bottomlock.observability.console import console_lines
from bottomlock.observability.report import observe_paper, observe_scenario


def observe(
    case: str | None = None,
    *,
    out: Annotated[
        Path | None,
        Parameter(
            alias="-o", help="Directory for tables and figures; CASE_states or paper_states by default."
        ),
    ] = None,
    paper: Annotated[
        bool,
        Parameter(negative="", help="Analyse the six cases of Klein & Diamant 2015 in place of a scenario."),
    ] = False,
    force: Force = False,
) -> None:
    """Analyse which states can be estimated, and which manoeuvre helps.

    For every set of beams of a scenario's instrument, along its truth.

    Parameters
    ----------
    case
        Packaged scenario (see `bottomlock list scenarios`) or TOML file.
    """
    if paper == (case is not None):
        raise ScenarioError(expected="either a scenario or --paper")
    out = out or beside(Path(case or "paper"), "states")
    made = observe_paper(out, force=force) if case is None else observe_scenario(case, out, force=force)
    for part in console_lines(made):
        console.print(part, highlight=False)
    console.print(f"wrote {'a table' if case is None else 'tables and a figure'} to {out}", soft_wrap=True)
