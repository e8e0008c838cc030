"""The commands `bottomlock masks` and `bottomlock certify`: studies over many campaigns."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import polars as pl
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from bottomlock import masks as mask_study
from bottomlock import recovery, study
from bottomlock.errors import ScenarioError
from bottomlock.scenario import Scenario, load_scenario

console = Console(stderr=False)
errors = Console(stderr=True, soft_wrap=True, highlight=False)

Out = Annotated[Path, Parameter(help="Directory for the results: new, or of the same study to resume.")]
Runs = Annotated[int | None, Parameter(help="Number of runs; the scenario's own by default.")]
Seed = Annotated[int | None, Parameter(help="Seed; the scenario's own by default.")]
Threads = Annotated[int, Parameter(help="Threads; 0 for as many as there are cores.")]
Arms = Annotated[str | None, Parameter(help="Arms, separated by commas; the scenario's own by default.")]
Force = Annotated[bool, Parameter(negative="", help="Start over in a directory of another study.")]


def _split(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",") if part.strip()]


def _load(
    names: Sequence[str], runs: int | None, seed: int | None, arms: str | None, threads: int
) -> list[Scenario]:
    if not names:
        raise ScenarioError("no scenario is named; `bottomlock scenarios` lists those that ship")
    if threads < 0:
        raise ScenarioError(f"--threads is {threads}, expected 0 or more")
    loaded = [
        load_scenario(name).with_overrides(runs=runs, seed=seed, arms=_split(arms)) for name in names
    ]
    found = [scenario.name for scenario in loaded]
    if len(set(found)) != len(found):
        raise ScenarioError(f"expected scenarios of different names, got {found}")
    return loaded


@contextmanager
def _progress(out: Path) -> Iterator[Progress]:
    columns = (TextColumn("{task.description:>22}"), BarColumn(), TextColumn("left"), TimeRemainingColumn())
    try:
        with Progress(*columns, console=errors) as progress:
            yield progress
    except KeyboardInterrupt:
        errors.print(f"interrupted; finished parts are kept in {out}: the same command resumes")
        raise


def _number(value: float | None, digits: int) -> str:
    if value is None:
        return "-"
    return f"{value:.{digits}f}" if abs(value) < 1e4 else f"{value:.0e}"


def _table(title: str, left: Sequence[str], right: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in left:
        table.add_column(name, no_wrap=True)
    for name in right:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def mask_tables(table: pl.DataFrame) -> Iterator[Table]:
    """A table per trajectory and case, narrow enough for 80 columns."""
    for (trajectory, case, beams), rows in table.group_by("trajectory", "case", "beams", maintain_order=True):
        title = (
            f"{trajectory}, {case}" if beams == "varying" else f"{trajectory}, beams {beams}"
        ) + ": RMS over runs at the end"
        shown = _table(title, ["arm"], ["v m/s", "95 %", "att deg", "pos m", "NEES", "NEES 6", "rej %"])
        shown.add_column("verdict", no_wrap=True)
        for row in rows.iter_rows(named=True):
            low, high = (_number(row[f"velocity_rms_{end}_mps"], 2) for end in ("lo", "hi"))
            rejected = row["rejected_part"]
            shown.add_row(
                row["arm"],
                _number(row["velocity_rms_mps"], 3),
                f"{low}..{high}",
                _number(row["attitude_rms_deg"], 2),
                _number(row["position_rms_m"], 1),
                _number(row["nees_mean"], 1),
                _number(row["nees_velocity_attitude_mean"], 1),
                "-" if rejected is None else f"{100.0 * rejected:.1f}",
                row["verdict"],
            )
        yield shown


def recovery_tables(summary: pl.DataFrame) -> Iterator[Table]:
    """A table per trajectory: an arm a line, the worst over the pairs."""
    for (trajectory,), rows in summary.group_by("trajectory", maintain_order=True):
        shown = _table(
            f"{trajectory}: beams back after {recovery.OUTAGE_S:g} s of two",
            ["arm"],
            ["step/sigma", "runs > 3", "NIS 1", "NIS 5", "of", "back at", "rej %", "pairs recovered"],
        )
        for (arm,), pairs in rows.group_by("arm", maintain_order=True):
            back = pairs["back_at_epoch"]
            good = int(pairs["recovered"].to_numpy().sum())
            shown.add_row(
                str(arm),
                _number(pairs["step_sigmas_max"].to_numpy().max(), 2),
                str(int(pairs["jumps"].to_numpy().sum())),
                _number(pairs["nis_1"].to_numpy().max(), 1),
                _number(pairs["nis_5"].to_numpy().max(), 1),
                str(pairs["degrees"][0]),
                "never" if back.null_count() else str(back.to_numpy().max()),
                f"{100.0 * pairs['rejected_part'].to_numpy().max():.1f}",
                f"{good} of {pairs.height}",
            )
        yield shown


def masks(
    *scenario: str,
    out: Out,
    runs: Runs = None,
    seed: Seed = None,
    threads: Threads = 0,
    arms: Arms = None,
    cases: Annotated[
        str | None,
        Parameter(help="Some cases, separated by commas: 12 (those beams), dropouts, slope; all by default."),
    ] = None,
    force: Force = False,
) -> None:
    """Flies every partial mask, dropouts and a slope, and the return of beams after a minute of two.

    Parameters
    ----------
    scenario
        Packaged names (see `bottomlock scenarios`) or TOML files, one or more.
    """
    loaded = _load(scenario, runs, seed, arms, threads)
    for one in loaded:
        mask_study.select(mask_study.all_cases(one), _split(cases))
    outages = _split(cases) is None and all(recovery.two_beam_outages(one) for one in loaded)
    configuration = mask_study.configuration(loaded)
    study.claim(out, mask_study.KIND, configuration, parts=mask_study.PARTS, force=force)
    with _progress(out) as progress:
        task = progress.add_task("", total=1.0)

        def flown(case: str, state: mask_study.Progress) -> None:
            progress.update(
                task, description=f"{state.trajectory} {case}", completed=state.runs_done / state.runs_total
            )

        def back(trajectory: str, done: int) -> None:
            total = max(one.campaign.runs for one in loaded)
            progress.update(task, description=f"{trajectory} recovery", completed=done / total)

        table = mask_study.run_masks(loaded, out, wanted=_split(cases), threads=threads, tell=flown)
        summary = recovery.run_recovery(loaded, out, tell=back)[1] if outages else None
    for shown in mask_tables(table):
        console.print(shown)
    console.print("NEES: whole state (20, or 15 without the DVL's); NEES 6: velocity and attitude; verdict on it.")
    if summary is not None:
        for shown in recovery_tables(summary):
            console.print(shown)
        console.print(
            "Worst over the pairs of beams. NIS is the mean over runs at the first and fifth fix of full lock; "
            f"the whole summary says 'not recovered' of an honest filter in {recovery.FALSE_ALARM:.0%} of studies."
        )
    study.write_manifest(
        out, mask_study.KIND, configuration, status="complete",
        runs={one.name: one.campaign.runs for one in loaded}, seed={one.name: one.campaign.seed for one in loaded},
    )  # fmt: skip
    console.print(f"tables in {out}")
    sys.stdout.flush()
