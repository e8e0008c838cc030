"""The command `bottomlock look`: from logs to the page of a replay in one step."""

import webbrowser
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from bottomlock.cli.common import Force
from bottomlock.cli.console import say
from bottomlock.cli.parameters import Out, Threads, beside


def look(
    *files: Path,
    out: Out = None,
    open_page: Annotated[bool, Parameter(name="--open", negative="--no-open")] = True,
    threads: Threads = 0,
    force: Force = False,
) -> None:
    """Look at logs of a dive: write a case from them, replay it, open its page.

    The case is `case.toml` in the directory. Answer its questions and call `bottomlock replay` with it.

    Args:
        files: The log of a DVL, and tables, bags or logs of an autopilot with IMU, depth, attitude, positions.
        out: Directory for the case and its replay; FILE_look beside the first file by default.
        open_page: Open the page in the browser.
    """
    from bottomlock.cli.replay import first_of, init_case, replay
    from bottomlock.replay.report import PAGE

    folder = out or beside(first_of(files), "look")
    case, replayed = folder / "case.toml", folder / "replay"
    init_case(files, case, force=force, without=())
    replay(case, out=replayed, threads=threads, force=force)
    page = (replayed / PAGE).resolve()
    if open_page and not webbrowser.open(page.as_uri()):
        say(f"no browser could be opened; the page is {page}")
