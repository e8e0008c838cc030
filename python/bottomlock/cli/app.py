"""The command `bottomlock`: the commands by name, each imported when it is called, and the exit codes."""

import sys
from typing import NoReturn

import cyclopts
from cyclopts import App

from bottomlock import __version__
from bottomlock.cli.console import EXIT_INTERRUPTED, EXIT_USAGE, console, errors
from bottomlock.errors import BottomlockError
from bottomlock.kernel import KernelError

COMMANDS = {
    "run": ("campaign", "Flies a Monte Carlo campaign and prints the table of RMS errors."),
    "merge": ("campaign", "Joins the shards of a campaign."),
    "fly": ("simulate", "Swims scenarios with the vehicle: truth, telemetry, a figure per trajectory."),
    "scenarios": ("scenarios", "Lists the packaged scenarios, or copies one."),
    "fix": ("fix", "Turns recorded pings into velocity fixes with covariance."),
    "reproduce": ("report", "Flies the whole study of the 2017 paper, judges its claims, writes the report."),
    "report": ("report", "Makes report.html and figures from the tables of a campaign or a replay."),
    "masks": ("studies", "Flies every partial mask, dropouts and a slope."),
    "consistency": ("studies", "Judges NEES and NIS of every method, mask and trajectory."),
    "replay": ("replay", "Navigates a recorded dive again, with fewer beams too."),
    "score": ("replay", "Leaves beams out of recorded pings."),
    "audit": ("audit", "Says what a log tells of its DVL."),
    "observe": ("observe", "Tells what can be estimated, and by which manoeuvre."),
    "convert": ("convert", "Converts a recorded DVL log to a beam table."),
}
"""Module of `bottomlock.cli` and help line of each command; a module is imported when its command is called."""

app = App(
    name="bottomlock",
    help="Aided inertial navigation with whatever Doppler velocity log beams are left.",
    version=__version__,
    console=console,
)
for _name, (_module, _help) in COMMANDS.items():
    app.command(f"bottomlock.cli.{_module}:{_name}", name=_name, help=_help)


def _fail(message: str) -> NoReturn:
    for line in message.splitlines():
        errors.print(f"bottomlock: {line}", markup=False)
    sys.exit(EXIT_USAGE)


def main() -> None:
    """Entry point: faults of usage and data end with exit code 2 and a line that names the place."""
    try:
        app(exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        _fail(" ".join(str(error).split()) + "; see `bottomlock --help`")
    except (BottomlockError, KernelError) as error:
        _fail(str(error))
    except KeyboardInterrupt:
        sys.exit(EXIT_INTERRUPTED)
