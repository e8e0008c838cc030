"""The commands `bottomlock reproduce` and `bottomlock report`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from bottomlock.cli.common import Force, ForceStudy
from bottomlock.cli.console import console
from bottomlock.cli.parameters import Out, Seed, StudyOut, Threads, check_threads
from bottomlock.errors import DataError

if TYPE_CHECKING:
    from bottomlock.report.page import Report


def reproduce(
    *,
    out: StudyOut,
    runs: Annotated[int, Parameter(alias="-n")] = 500,
    seed: Seed = None,
    threads: Threads = 0,
    force: ForceStudy = False,
) -> None:
    """Reproduce the 2017 paper: run its study, test its claims, write the report.

    Args:
        runs: Number of runs of each trajectory.
    """
    from bottomlock.campaign.run import check_campaign
    from bottomlock.cli.campaign_output import progress_bar
    from bottomlock.studies import reproduce as whole_study

    check_threads(threads)
    scenarios = whole_study.study_scenarios(runs, seed)
    check_campaign(scenarios, out, force=force)
    with progress_bar(out, whole_study.study_runs(runs)) as progress:
        settings: Any = {"runs": runs, "seed": seed, "threads": threads, "force": force}
        written = whole_study.reproduce(out, progress=progress, **settings)
    print_report(written)


def report(
    *directory: Path,
    out: Out = None,
    against: str | None = None,
    force: Force = False,
) -> None:
    """Write the report of a campaign or a replay, or lay several campaigns side by side.

    Of one directory: report.html and figures from its tables; where a campaign flew the paper's scenarios with its
    settings, the report tests the paper's claims, too. Of several: a table of errors and of their differences, run by
    run where the seeds and the trajectories are the same.

    Args:
        directory: Directory of a finished campaign (`bottomlock run`), of its variants, or of a replay (`bottomlock
            replay`); several campaigns are compared.
        out: Directory for the page of several campaigns; that of variants, otherwise none by default.
        against: Of several campaigns the one that differences are taken to; the first by default.
    """
    from bottomlock.cli.campaign_output import print_comparison
    from bottomlock.files.campaign_tables import VARIANTS
    from bottomlock.replay.report import is_replay, make_replay_report
    from bottomlock.report.compare import compare
    from bottomlock.report.page import make_report

    if not directory:
        raise DataError("no directory is named", expected="that of a campaign or a replay")
    first, *others = directory
    if others or (first / VARIANTS).is_file():
        place = first if out is None and not others else out
        print_comparison(compare(directory, place, against=against, force=force))
        return
    if out is not None or against is not None:
        raise DataError("--out and --against are of several campaigns, and one directory is named")
    if first.is_file():
        raise DataError("is a file", place=first, expected="the folder of a campaign or a replay")
    if is_replay(first):
        console.print(f"wrote {make_replay_report(first, force=force)}")
    else:
        print_report(make_report(first, force=force))


def print_report(written: Report) -> None:
    """Prints where the page is, and the count of each verdict where the paper's claims were tested."""
    if written.claims.height:
        verdicts = written.claims["verdict"].value_counts().sort("verdict")
        console.print(
            "the paper's claims: " + ", ".join(f"{count} {word}" for word, count in verdicts.iter_rows())
        )
    tables = " and tables/claims.parquet" if written.claims.height else ""
    console.print(f"wrote {written.page}, {written.figures} figures{tables}")
