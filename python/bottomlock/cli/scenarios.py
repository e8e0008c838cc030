"""The command `bottomlock scenarios`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from bottomlock.cli.console import console
from bottomlock.config.scenario import copy_scenario, packaged_scenarios


def scenarios(
    *,
    copy: Annotated[str | None, Parameter(help="Write this packaged scenario out to edit.")] = None,
    to: Annotated[Path | None, Parameter(help="Where to; NAME.toml here by default.")] = None,
) -> None:
    """Lists the packaged scenarios, or copies one."""
    if copy is not None:
        console.print(f"wrote {copy_scenario(copy, to or Path(f'{copy}.toml'))}")
        return
    table = Table()
    table.add_column("scenario")
    table.add_column("what it is")
    for name, description in packaged_scenarios().items():
        table.add_row(name, description)
    console.print(table)
