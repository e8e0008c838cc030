"""The command `bottomlock`: its subcommands by name, each imported when it is called, and the exit codes."""

import importlib.metadata
import sys
import time
import traceback
from typing import NoReturn

import cyclopts
from cyclopts import App, Group, Parameter

from bottomlock.cli.common import peak_memory_mb, split_common
from bottomlock.cli.console import EXIT_USAGE, errors, help_console, prepare_consoles
from bottomlock.cli.examples import epilogue
from bottomlock.errors import BottomlockError

JOBS = {
    "Recorded logs": {
        "audit": ("audit", "Audit a DVL log: beam directions, order, signs, defects, mounting."),
        "convert": ("convert", "Convert a recorded DVL log to a beam table."),
        "fix": (
            "fix",
            "Solve recorded pings for velocity fixes with covariance, or score the methods on them.",
        ),
        "look": ("look", "Look at logs of a dive: write a case from them, replay it, open its page."),
        "replay": ("replay", "Navigate a recorded dive again, also with fewer beams."),
        "tune": ("tune", "Find the noise of a recorded dive from the recording itself, without a reference."),
    },
    "Live": {
        "live": ("live", "Navigate live: from DVL, IMU and depth to the ports of an autopilot."),
        "live-demo": (
            "live_demo",
            "Show live navigation without hardware: instruments, live, MAVLink listener.",
        ),
        "live-setup": (
            "live_setup",
            "Set live navigation up in a browser: instrument, autopilot, mounting; start, stop, state, raw logs.",
        ),
        "simulate-dvl": (
            "simulate_dvl",
            "Simulate a DVL that sends a maker's bytes over TCP, UDP, a serial line or a file.",
        ),
    },
    "Simulation": {
        "fly": (
            "simulate",
            "Simulate the vehicle, or fly a trajectory from a file: truth, telemetry, figure.",
        ),
        "report": (
            "report",
            "Write the report of a campaign or a replay, or lay several campaigns side by side.",
        ),
        "run": ("campaign", "Run a Monte Carlo campaign and print a table of RMS errors."),
    },
    "Studies": {
        "observe": ("observe", "Analyse which states can be estimated, and which manoeuvre helps."),
        "reproduce": (
            "report",
            "Reproduce the 2017 paper: run its study, test its claims, write the report.",
        ),
        "study": (
            "study",
            "Compare the methods under sets of returning beams and sensors: errors, NEES, NIS, verdicts.",
        ),
    },
    "Look up": {
        "keys": (
            "keys",
            "Print every key of a scenario, case, geometry, vehicle, column map or live file, or its JSON schema.",
        ),
        "list": (
            "listing:list_",
            "List scenarios, vehicles, geometries, grades, methods or formats of the package, or copy one.",
        ),
    },
}
"""By job, in the order of the help: module of `bottomlock.cli`, or MODULE:FUNCTION, and help line of each command."""
COMMANDS = {name: entry for commands in JOBS.values() for name, entry in commands.items()}
USAGE = {
    "run": "[OPTIONS] SCENARIO...",
    "report": "[OPTIONS] DIRECTORY...",
    "fly": "[OPTIONS] SCENARIO...",
    "keys": "[OPTIONS] KIND [WORD]",
    "list": "[OPTIONS] KIND",
    "study": "--out PATH [OPTIONS] [SCENARIO...]",
    "look": "[OPTIONS] FILES...",
    "replay": "[OPTIONS] FILES...",
    "observe": "[OPTIONS] [SCENARIO]",
}
"""Usage of the commands whose positional arguments may be several or be left out: they are named."""


def _shown_default(value: object) -> str | None:
    """A default on a help page; None for what says nothing."""
    return None if value is None or value in ((), "") else str(value)


app = App(
    name="bottomlock",
    default_parameter=Parameter(show_default=_shown_default, negative=""),
    help="Aided inertial navigation with whatever Doppler velocity log beams are left.",
    help_epilogue=(
        "With every command: -q, --quiet prints errors alone; -v, --verbose ends with times, and after an "
        "error with its traceback; --no-progress draws no bar. NO_COLOR is honoured. Exit codes: 0 done, 1 done but "
        "not as expected, 2 wrong usage or data, 130 interrupted (docs/command_line.md)."
    ),
    version=lambda: importlib.metadata.version("bottomlock"),
    version_flags=["--version", "-V"],
    suppress_keyboard_interrupt=False,  # `__main__` answers it, in whatever import it comes
    console=help_console,
)
for _job, _commands in JOBS.items():
    _group = Group.create_ordered(_job)
    for _name, (_module, _help) in _commands.items():
        app.command(
            f"bottomlock.cli.{_module}" + ("" if ":" in _module else f":{_name.replace('-', '_')}"),
            name=_name,
            group=_group,
            help=_help,
            help_epilogue=epilogue(_name),
            **({"usage": f"Usage: bottomlock {_name} {USAGE[_name]}"} if _name in USAGE else {}),
        )


for _flag in ("--help", "--version"):
    app[_flag].group = _group


def _fail(message: str) -> NoReturn:
    # Not splitlines: a carriage return of a file name starts no line of ours.
    for line in message.split("\n"):
        errors.print(f"bottomlock: {line}")
    sys.exit(EXIT_USAGE)


def main() -> None:
    """Runs the command; faults of usage and of data end with exit code 2 and one line that names the place."""
    tokens, common = split_common(sys.argv[1:])
    prepare_consoles(common)
    started = time.perf_counter()
    try:
        app(tokens, exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        reason = " ".join(str(error).split())
        reason = reason if reason.endswith("...") else reason.removesuffix(".")
        _fail(f"{reason}; see `{' '.join(['bottomlock', *(error.command_chain or ())])} --help`")
    except MemoryError:
        _fail("the memory does not suffice; take a part of the file, or a machine with more")
    except BottomlockError as error:
        if common.verbose:
            errors.print(traceback.format_exc().rstrip())
        _fail(str(error))
    finally:
        if common.verbose:
            errors.print(
                f"bottomlock: {time.perf_counter() - started:.2f} s, {peak_memory_mb():.0f} MB at most"
            )
