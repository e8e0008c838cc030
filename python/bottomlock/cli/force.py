"""The option --force of every command that writes; apart, so that a quick start need not import scenarios."""

from typing import Annotated

from cyclopts import Parameter

Force = Annotated[
    bool,
    Parameter(
        negative="", help="Replace a file that is there, or a result of other inputs in the directory."
    ),
]
ForceCampaign = Annotated[
    bool, Parameter(negative="", help="Start over in a directory that holds another campaign.")
]
ForceStudy = Annotated[
    bool, Parameter(negative="", help="Start over in a directory that holds another study.")
]
