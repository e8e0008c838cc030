"""The command `bottomlock scenarios`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from bottomlock.cli.console import console
from bottomlock.cli.force import Force
from bottomlock.cli.parameters import Json
from bottomlock.config.scenario import copy_scenario, packaged_scenarios
from bottomlock.files.atomic_write import json_text


def scenarios(
    *,
    copy: Annotated[str | None, Parameter(help="Name of a packaged scenario to copy for editing.")] = None,
    out: Annotated[
        Path | None,
        Parameter(alias=("-o", "--to"), help="File to write; NAME.toml in this directory by default."),
    ] = None,
    json: Json = False,
    force: Force = False,
) -> None:
    """List the packaged scenarios, or copy one."""
    if copy is not None:
        file = copy_scenario(copy, out or Path(f"{copy}.toml"), force=force)
        console.print(f"wrote {file}; edit it, then: bottomlock run {file} --out out", soft_wrap=True)
        return
    if json:
        console.file.write(json_text(packaged_scenarios()))
        return
    table = Table()
    table.add_column("scenario")
    table.add_column("description")
    for name, description in packaged_scenarios().items():
        table.add_row(name, description)
    console.print(table)
