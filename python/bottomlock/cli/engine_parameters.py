"""Parameters of the commands that run on an engine: this process, or a cluster."""

from typing import Annotated

from cyclopts import Parameter

from bottomlock.campaign.engine import ENGINES

EngineName = Annotated[
    str, Parameter(help=f"{' or '.join(ENGINES)}: this process, or the workers of a Dask cluster.")
]
Scheduler = Annotated[
    str | None,
    Parameter(help="Dask scheduler, tcp://host:port; by default worker processes on this machine."),
]
