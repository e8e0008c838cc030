"""The commands `bottomlock reproduce` and `bottomlock report`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from bottomlock.cli.campaign_output import progress_bar
from bottomlock.cli.console import console, interrupted
from bottomlock.errors import ScenarioError
from bottomlock.replay.report import is_replay, make_replay_report
from bottomlock.report.page import Report, make_report
from bottomlock.studies import reproduce as whole_study


def reproduce(
    *,
    out: Annotated[Path, Parameter(help="Directory for the study: new, or of the same study to resume.")],
    runs: Annotated[int, Parameter(help="Runs of each trajectory.")] = whole_study.RUNS,
    seed: Annotated[int | None, Parameter(help="Seed; the scenarios' own by default.")] = None,
    threads: Annotated[int, Parameter(help="Threads; 0 for as many as there are cores.")] = 0,
    force: Annotated[
        bool, Parameter(negative="", help="Start over in a directory of another study.")
    ] = False,
) -> None:
    """Flies the whole study of the 2017 paper, judges its claims, and writes the report."""
    if threads < 0:
        raise ScenarioError(f"--threads is {threads}, expected 0 or more")
    try:
        with progress_bar(whole_study.study_runs(runs)) as progress:
            made = whole_study.reproduce(
                out, runs=runs, seed=seed, threads=threads, force=force, progress=progress
            )
    except KeyboardInterrupt:
        interrupted(out)
    print_report(made)


def report(directory: Path) -> None:
    """Makes report.html and figures from the tables of a campaign or a replay; of a campaign, the paper's claims too.

    Parameters
    ----------
    directory
        Where `bottomlock run` has written a finished campaign, or `bottomlock replay` a replay.
    """
    if is_replay(directory):
        console.print(f"wrote {make_replay_report(directory)}")
    else:
        print_report(make_report(directory))


def print_report(made: Report) -> None:
    """Prints the count of each verdict and where the page is."""
    verdicts = made.claims["verdict"].value_counts().sort("verdict")
    console.print(
        "the paper's claims: " + ", ".join(f"{count} {word}" for word, count in verdicts.iter_rows())
    )
    console.print(f"wrote {made.page}, {len(made.figures)} figures and tables/claims.parquet")
