"""The commands `bottomlock masks` and `bottomlock consistency`: studies over many campaigns."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import polars as pl
from cyclopts import Parameter
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from bottomlock.atomic_write import write_text
from bottomlock.campaign.run import CampaignProgress
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.pages.numbers import plain
from bottomlock.statistics import chi_squared
from bottomlock.studies import consistency as consistency_study
from bottomlock.studies import masks as mask_study
from bottomlock.studies import recovery, study_folder
from bottomlock.studies.cases import VARYING, beam_list
from bottomlock.studies.consistency_table import counts_of, methods_summary
from bottomlock.studies.expected_verdicts import check_names, departures, read_expectations
from bottomlock.studies.masks_page import markdown, worst_of_pairs

console = Console(stderr=False)
errors = Console(stderr=True, soft_wrap=True, highlight=False)

Out = Annotated[Path, Parameter(help="Directory for the results: new, or of the same study to resume.")]
Runs = Annotated[int | None, Parameter(help="Number of runs; the scenario's own by default.")]
Seed = Annotated[int | None, Parameter(help="Seed; the scenario's own by default.")]
Threads = Annotated[int, Parameter(help="Threads; 0 for as many as there are cores.")]
Methods = Annotated[
    str | None, Parameter(help="Methods, separated by commas; the scenario's own by default.")
]
Force = Annotated[bool, Parameter(negative="", help="Start over in a directory of another study.")]


def _split(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",") if part.strip()]


def _load(
    names: Sequence[str], runs: int | None, seed: int | None, methods: str | None, threads: int
) -> list[Scenario]:
    if not names:
        raise ScenarioError("no scenario is named; `bottomlock scenarios` lists those that ship")
    if threads < 0:
        raise ScenarioError(f"--threads is {threads}, expected 0 or more")
    loaded = [
        load_scenario(name).with_overrides(runs=runs, seed=seed, methods=_split(methods)) for name in names
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


def _table(title: str, left: Sequence[str], right: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in left:
        table.add_column(name, no_wrap=True)
    for name in right:
        table.add_column(name, justify="right", no_wrap=True)
    return table


_SHORT = {chi_squared.CONSISTENT: "good", chi_squared.OVERCONFIDENT: "over", chi_squared.CAUTIOUS: "cautious"}


def mask_tables(table: pl.DataFrame, returning: Mapping[tuple[str, str], float]) -> Iterator[Table]:
    """A table per trajectory and case, narrow enough for 80 columns; `returning`: mean beams of those that vary."""
    for (trajectory, case, beams), rows in table.group_by("trajectory", "case", "beams", maintain_order=True):
        mean = returning.get((str(trajectory), str(case)))
        what = f"beams {beams}" if mean is None else f"{case} ({mean:.1f} beams a ping)"
        title = f"{trajectory}, {what}: RMS over runs at the end"
        shown = _table(title, ["method"], ["v m/s", "95 %", "att deg", "pos m", "NEES", "NEES 6", "rej %"])
        shown.add_column("", no_wrap=True)
        for row in rows.iter_rows(named=True):
            low, high = (plain(row[f"velocity_rms_over_runs_{end}_mps"], digits=4) for end in ("lo", "hi"))
            rejected = row["rejected_fraction"]
            shown.add_row(
                row["method"],
                plain(row["velocity_rms_over_runs_mps"], digits=4),
                f"{low} .. {high}",
                plain(row["attitude_rms_over_runs_deg"], digits=3, decimals=2),
                plain(row["position_rms_over_runs_m"], digits=3, decimals=2),
                plain(row["nees_mean_over_runs_and_time"], digits=2, decimals=1),
                plain(row["nees_velocity_attitude_mean_over_runs_and_time"], digits=2, decimals=1),
                "-" if rejected is None else f"{100.0 * rejected:.1f}",
                _SHORT[row["verdict"]],
            )
        yield shown


def recovery_tables(summary: pl.DataFrame) -> Iterator[Table]:
    """A table per trajectory: a method a line, the worst over the pairs."""
    for (trajectory,), rows in worst_of_pairs(summary).group_by("trajectory", maintain_order=True):
        shown = _table(
            f"{trajectory}: beams back after {recovery.OUTAGE_S:g} s of two",
            ["method"],
            ["step/σ", "runs > 3", "NIS 1", "NIS 5", "of", "back", "rej %", "pairs"],
        )
        for row in rows.iter_rows(named=True):
            back = row["back_at_epoch"]
            shown.add_row(
                row["method"],
                plain(row["step_sigmas_max"], digits=3, decimals=2),
                str(row["jumps"]),
                plain(row["nis_1"], digits=2, decimals=1),
                plain(row["nis_5"], digits=2, decimals=1),
                str(row["degrees"]),
                "never" if back is None else str(back),
                f"{100.0 * row['rejected_fraction']:.1f}",
                f"{row['pairs_recovered']} of {row['pairs']}",
            )
        yield shown


def masks(
    *scenario: str,
    out: Out,
    runs: Runs = None,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
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
    loaded = _load(scenario, runs, seed, methods, threads)
    wanted = _split(cases)
    chosen = [mask_study.select(mask_study.all_cases(one), wanted) for one in loaded]
    outages = wanted is None and _room_for_outages(loaded)
    configuration = mask_study.configuration(loaded)
    study_folder.claim(out, mask_study.KIND, configuration, parts=mask_study.PARTS, force=force)
    with _progress(out) as progress:
        task = progress.add_task("", total=1.0)

        def flown(case: str, state: CampaignProgress) -> None:
            progress.update(
                task, description=f"{state.trajectory} {case}", completed=state.runs_done / state.runs_total
            )

        def back(trajectory: str, done: int) -> None:
            total = max(one.campaign.runs for one in loaded)
            progress.update(task, description=f"{trajectory} recovery", completed=done / total)

        table = mask_study.run_masks(loaded, out, wanted=wanted, threads=threads, progress=flown)
        summary = recovery.run_recovery(loaded, out, progress=back)[1] if outages else None
    write_text(out / "masks.md", markdown(table, summary))
    returning = {
        (case.scenario.name, case.name): mask_study.mean_beams(case)
        for found in chosen
        for case in found
        if case.beams == VARYING
    }
    for shown in mask_tables(table, returning):
        console.print(shown)
    console.print(
        "NEES is that of the whole state, NEES 6 of velocity and attitude; the verdict is on the latter: good "
        "(consistent), over(confident) or conservative."
    )
    if summary is not None:
        for shown in recovery_tables(summary):
            console.print(shown)
        console.print(
            "Worst over the pairs of beams: step of velocity over its claimed σ, mean NIS over runs at the first and "
            "fifth fix of full lock, the fix from which it stays in its band, the pairs where both are in order; "
            f"the whole summary says 'not recovered' of an honest filter in {recovery.FALSE_ALARM:.0%} of studies."
        )
    study_folder.write_manifest(
        out, mask_study.KIND, configuration, status="complete",
        runs={one.name: one.campaign.runs for one in loaded}, seed={one.name: one.campaign.seed for one in loaded},
    )  # fmt: skip
    console.print(f"tables in {out}")


def _room_for_outages(scenarios: Sequence[Scenario]) -> bool:
    """Whether recovery can be flown; says why where it cannot, since the masks are worth having without it."""
    try:
        for scenario in scenarios:
            recovery.two_beam_outages(scenario)
    except ScenarioError as error:
        errors.print(f"no recovery is flown: {error}", markup=False)
        return False
    return True


TRAJECTORIES = ("straight", "figure_eight", "lawn_mower")


def consistency(
    *scenario: str,
    out: Out,
    runs: Annotated[int, Parameter(help="Number of runs of each cell.")] = 100,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
    masks: Annotated[
        str | None, Parameter(help="Sets of returning beams, such as 1234,123,12; every one by default.")
    ] = None,
    asserted: Annotated[
        Path | None,
        Parameter(name="--assert", help="TOML file of expected verdicts: a departure ends with exit code 1."),
    ] = None,
    force: Force = False,
) -> None:
    """Writes the consistency study: methods x masks x trajectories, NEES and NIS with verdicts.

    Parameters
    ----------
    scenario
        Packaged names or TOML files; the three trajectories of the paper by default.
    """
    expectations = None if asserted is None else read_expectations(asserted)
    loaded = _load(scenario or TRAJECTORIES, runs, seed, methods, threads)
    if len({one.dvl.beams for one in loaded}) != 1:
        raise ScenarioError("expected scenarios whose instruments have the same number of beams")
    sets = consistency_study.parse_masks(masks, loaded[0].dvl.beams)
    if expectations is not None:
        check_names(
            expectations,
            methods={method for one in loaded for method in one.campaign.methods},
            trajectories={one.name for one in loaded},
            beams={beam_list(mask) for mask in sets},
        )
    given = {"--runs": runs, "--seed": seed, "--methods": methods, "--masks": masks}
    options = " ".join(f"{name} {value}" for name, value in given.items() if value is not None)
    command = " ".join(["bottomlock consistency", *scenario, "--out DIR", options])
    configuration = consistency_study.configuration(loaded, sets)
    study_folder.claim(out, consistency_study.KIND, configuration, parts=consistency_study.PARTS, force=force)
    with _progress(out) as progress:
        task = progress.add_task("", total=None)

        def finished(cell: str, done: int, total: int) -> None:
            progress.update(task, description=cell, completed=done, total=total)

        table = consistency_study.run_consistency(
            loaded, sets, out, command=command, threads=threads, progress=finished
        )
    study_folder.write_manifest(
        out, consistency_study.KIND, configuration, status="complete", command=command
    )
    console.print(methods_table(table))
    console.print(
        "Cells consistent / overconfident / conservative; consistent: NEES 6 consistent and nothing overconfident."
    )
    console.print(
        f"false-alarm rate of the whole: {consistency_study.FALSE_ALARM:.0%}; consistency.md in {out}"
    )
    if expectations is not None:
        found = departures(table, expectations)
        for line in found:
            errors.print(f"bottomlock: {line}", markup=False)
        if found:
            sys.exit(EXIT_DEPARTURE)
        console.print("every verdict is as expected")


EXIT_DEPARTURE = 1


def methods_table(table: pl.DataFrame) -> Table:
    """The summary of a consistency study, a method a line."""
    shown = _table("Consistency", ["method"], ["cells", "consistent", "NEES 6", "NEES", "NIS"])
    for row in methods_summary(table).iter_rows(named=True):
        shown.add_row(row["method"], str(row["cells"]), str(row["consistent"]), *counts_of(row))
    return shown
