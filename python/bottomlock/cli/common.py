"""Options that every command has: quiet, verbose, no progress bar."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

_FLAGS = {
    "-q": "quiet", "--quiet": "quiet", "-v": "verbose", "--verbose": "verbose", "--no-progress": "no_progress",
}  # fmt: skip


@dataclass(frozen=True)
class Common:
    """Options of every command.

    Attributes:
        quiet: errors alone are printed.
        verbose: times at the end, and tracebacks of errors.
        no_progress: no bar is drawn.
    """

    quiet: bool = False
    verbose: bool = False
    no_progress: bool = False


def split_common(arguments: Sequence[str]) -> tuple[list[str], Common]:
    """A command line without the options of every command, and these; after `--` nothing is an option.

    >>> split_common(["run", "-q", "straight", "--", "-v"])
    (['run', 'straight', '--', '-v'], Common(quiet=True, verbose=False, no_progress=False))
    """
    end = arguments.index("--") if "--" in arguments else len(arguments)
    flags = {_FLAGS[word]: True for word in arguments[:end] if word in _FLAGS}
    rest = [word for word in arguments[:end] if word not in _FLAGS]
    return [*rest, *arguments[end:]], Common(**flags)


def peak_memory_mb() -> float:
    """The most memory that this process has had, MB; NaN where the system does not say."""
    try:
        import resource  # Windows has none
    except ImportError:
        return float("nan")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


Force = Annotated[
    bool, Parameter(help="Replace a file that is there, or a result of other inputs in the directory.")
]
ForceCampaign = Annotated[bool, Parameter(help="Start over in a directory that holds another campaign.")]
ForceStudy = Annotated[bool, Parameter(help="Start over in a directory that holds another study.")]
