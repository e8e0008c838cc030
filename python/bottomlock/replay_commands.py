"""The command `bottomlock replay`: a recorded dive navigated again, with the beams that it had and with fewer."""

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import polars as pl
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from bottomlock.errors import ScenarioError
from bottomlock.replay.case import load_case
from bottomlock.replay.run import Replayed, draws_of, prepare_folder, replay_case, write_replay
from bottomlock.replay_report import make_replay_report
from bottomlock.replay_stats import summary_table

console = Console(stderr=False)
errors = Console(stderr=True, soft_wrap=True, highlight=False)
EXIT_INTERRUPTED = 130


def replay(
    case: Path,
    *,
    out: Annotated[Path, Parameter(help="Directory for tables and report: new, or of the same case.")],
    arms: Annotated[
        str | None, Parameter(help="Arms, separated by commas; the case's own by default.")
    ] = None,
    runs: Annotated[
        int | None, Parameter(help="Draws of noise and chance; the case's own by default.")
    ] = None,
    seed: Annotated[int | None, Parameter(help="Seed; the case's own by default.")] = None,
    threads: Annotated[int, Parameter(help="Threads; 0 for as many as there are cores.")] = 0,
    force: Annotated[
        bool, Parameter(negative="", help="Start over in a directory of another replay.")
    ] = False,
) -> None:
    """Navigates a recorded dive again: every arm, with the beams as recorded and with those of every question.

    Parameters
    ----------
    case
        TOML file that names the tables, their columns, units and clocks, the start, and the questions.
    """
    if threads < 0:
        raise ScenarioError(f"--threads is {threads}, expected 0 or more")
    loaded = load_case(case).with_overrides(
        arms=None if arms is None else [arm.strip() for arm in arms.split(",") if arm.strip()],
        runs=runs,
        seed=seed,
    )
    prepare_folder(out, loaded.content_hash(), force=force)
    flights = draws_of(loaded) * (1 + len(loaded.what_if))
    columns = (
        TextColumn("replaying"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    try:
        with Progress(*columns, console=errors) as progress:
            task = progress.add_task("", total=flights)
            replayed = replay_case(
                loaded, threads=threads, tell=lambda done: progress.update(task, completed=done)
            )
            write_replay(replayed, out)
        page = make_replay_report(out)
    except KeyboardInterrupt:
        errors.print(f"interrupted; nothing was written to {out}")
        sys.exit(EXIT_INTERRUPTED)
    conclude(replayed)
    console.print(f"{replayed.manifest['wall_time_s']:.1f} s; tables in {out}, wrote {page}")


def _number(value: float | None, digits: int = 3) -> str:
    if value is None or not np.isfinite(value):
        return "-"
    if value != 0.0 and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.1e}"
    return f"{value:.{digits}g}" if abs(value) < 1000 else f"{value:.0f}"


def conclude(replayed: Replayed) -> None:
    """What came out, a table per question, narrow enough for 80 columns; and what is not as it was measured."""
    manifest = replayed.manifest
    for name, clock in manifest["clocks"].items():
        faults = {
            key: clock[key]
            for key in ("gaps", "jumps", "repeats", "backward", "empty")
            if clock[key] != "none"
        }
        for kind, words in faults.items():
            console.print(f"{name}: {kind} {words}", highlight=False)
    summary = summary_table(replayed.runs)
    label = ", semi-synthetic" if manifest["semi_synthetic"] else ""
    for question, words in manifest["what_if"]:
        table = Table(
            title=f"{manifest['case']}, {question}{label}: {words}",
            title_justify="left",
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
        )
        for name in ("arm", "pass"):
            table.add_column(name, no_wrap=True)
        against = ["end m", "% way", "v m/s", "att deg"] if manifest["has_reference"] else []
        for name in [*against, "NIS", "of", "fixes", "rej %"]:
            table.add_column(name, justify="right", no_wrap=True)
        for row in summary.filter(pl.col("what_if") == question).iter_rows(named=True):
            numbers = ["position_final_m", "position_final_percent", "velocity_rms_mps", "attitude_rms_deg"]
            shown = [_number(row[name]) for name in numbers] if manifest["has_reference"] else []
            part = row["rejected_part"]
            table.add_row(
                row["arm"], row["pass"], *shown, _number(row["nis_mean"]), _number(row["nis_degrees_mean"]),
                str(row["fixes"]), "-" if not row["fixes"] else f"{100.0 * part:.1f}",
            )  # fmt: skip
        console.print(table)
    if manifest["semi_synthetic"]:
        console.print(f"Semi-synthetic: {'; '.join(manifest['semi_synthetic'])}.")
    if manifest["reference_note"]:
        console.print(f"About the reference: {manifest['reference_note']}")
