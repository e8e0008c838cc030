"""The command `bottomlock masks`: every set of returning beams, and the recovery when lost beams return."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated

import polars as pl
from cyclopts import Parameter
from rich.table import Table

from bottomlock.campaign.run import CampaignProgress
from bottomlock.cli.console import console, errors, narrow_table
from bottomlock.cli.force import ForceStudy
from bottomlock.cli.parameters import (
    Methods,
    Recover,
    Runs,
    Seed,
    StudyOut,
    Threads,
    World,
    load_scenarios,
    split,
)
from bottomlock.cli.study_output import command_line, study_bar
from bottomlock.config.scenario import Scenario
from bottomlock.errors import ScenarioError
from bottomlock.files.atomic_write import write_text
from bottomlock.pages.numbers import plain
from bottomlock.statistics import chi_squared
from bottomlock.studies import masks as mask_study
from bottomlock.studies import recovery, study_folder, world_words
from bottomlock.studies.cases import VARYING, Case
from bottomlock.studies.masks_opening import opening, what_was_run
from bottomlock.studies.masks_page import markdown, verdict_at_edge, worst_of_pairs
from bottomlock.studies.study_sheets import masks_sheet

_SHORT = {chi_squared.CONSISTENT: "ok", chi_squared.OVERCONFIDENT: "over", chi_squared.CONSERVATIVE: "cons"}


def masks(
    *scenario: str,
    out: StudyOut,
    runs: Runs = None,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
    world: World = None,
    cases: Annotated[
        str | None,
        Parameter(
            help="Cases, separated by commas: 12 (beams 1 and 2 return), dropouts, slope; all by default."
        ),
    ] = None,
    force: ForceStudy = False,
    recover: Recover = False,
) -> None:
    """Run every set of returning beams, dropouts and a slope.

    With all cases, also the recovery after a minute of two beams.

    Parameters
    ----------
    scenario
        Packaged scenarios (see `bottomlock scenarios`) or TOML files, one or more.
    """
    loaded = load_scenarios(scenario, runs=runs, seed=seed, methods=methods, threads=threads, world=world)
    wanted = split(cases)
    kind, configuration = mask_study.KIND, mask_study.configuration(loaded)
    given = {"--world": world, "--runs": runs, "--seed": seed, "--methods": methods, "--cases": cases}
    command = command_line("masks", scenario, given)
    parts = mask_study.PARTS
    study_folder.check_owner(out, kind, configuration, parts=parts, force=force, recover=recover)
    chosen = [case for one in loaded for case in mask_study.select(mask_study.all_cases(one), wanted)]
    outages = wanted is None and _outages_fit(loaded)
    with study_folder.claimed(
        out, kind, configuration, parts=parts, scenarios=loaded, force=force, recover=recover
    ):
        table, summary = _run(loaded, out, wanted=wanted, outages=outages, threads=threads, recover=recover)
        write_text(out / "masks.md", opening(table, summary, loaded, command) + markdown(table, summary))
        run = [line.replace("`", "") for line in what_was_run(loaded, command)]
        write_text(out / "masks.html", masks_sheet(table, summary, run, world_words.limits(loaded)))
        study_folder.write_manifest(
            out, kind, configuration, status="complete",
            runs={one.name: one.campaign.runs for one in loaded}, seed={one.name: one.campaign.seed for one in loaded},
        )  # fmt: skip
    _print(table, summary, chosen)
    console.print(f"tables, masks.md and masks.html in {out}")


def _outages_fit(scenarios: Sequence[Scenario]) -> bool:
    """Whether the outages of the recovery fit; prints the reason where they do not, as the masks need none."""
    try:
        for scenario in scenarios:
            recovery.two_beam_outages(scenario)
    except ScenarioError as error:
        errors.print(f"recovery is not run: {error}")
        return False
    return True


def _run(
    scenarios: Sequence[Scenario],
    out: Path,
    *,
    wanted: list[str] | None,
    outages: bool,
    threads: int,
    recover: bool,
) -> tuple[pl.DataFrame, pl.DataFrame | None]:
    """The tables of the masks and of the recovery; a bar shows the progress."""
    with study_bar(out) as report:

        def case_progress(case: str, state: CampaignProgress) -> None:
            report(f"{state.trajectory} {case}", state.runs_done / state.runs_total)

        def recovery_progress(trajectory: str, done: int) -> None:
            report(f"{trajectory} recovery", done / max(one.campaign.runs for one in scenarios))

        table = mask_study.run_masks(
            scenarios, out, wanted=wanted, threads=threads, recover=recover, progress=case_progress
        )
        summary = recovery.run_recovery(scenarios, out, progress=recovery_progress)[1] if outages else None
    return table, summary


def _print(table: pl.DataFrame, summary: pl.DataFrame | None, cases: Sequence[Case]) -> None:
    returning = {
        (case.scenario.name, case.name): mask_study.mean_beams(case)
        for case in cases
        if case.beams == VARYING
    }
    for shown in mask_tables(table, returning):
        console.print(shown)
    console.print(
        "NEES: of the whole state; NEES 6: of velocity and attitude. The last column is the verdict on NEES 6: "
        "ok (consistent), over(confident), cons(ervative), or at the edge of two of them."
    )
    if summary is not None:
        for shown in recovery_tables(summary):
            console.print(shown)
        console.print(
            "Worst of the pairs of beams: step of velocity over its claimed σ; mean NIS over runs at the first and "
            "the fifth fix with all beams; the fix from which NIS stays in its band; the pairs where both hold. "
            f"A consistent filter fails somewhere in the whole summary in {recovery.FALSE_ALARM:.0%} of studies."
        )


def mask_tables(table: pl.DataFrame, returning: Mapping[tuple[str, str], float]) -> Iterator[Table]:
    """A table per trajectory and case, narrow enough for 80 columns; `returning`: mean beams where they vary."""
    for (trajectory, case, beams), rows in table.group_by("trajectory", "case", "beams", maintain_order=True):
        mean = returning.get((str(trajectory), str(case)))
        what = f"beams {beams}" if mean is None else f"{case} ({mean:.1f} beams per ping)"
        title = f"{trajectory}, {what}: RMS over runs at the end"
        shown = narrow_table(
            title, ["method"], ["v m/s", "95 %", "att deg", "pos m", "NEES", "NEES 6", "rej %"]
        )
        shown.add_column("", no_wrap=True)
        for row in rows.iter_rows(named=True):
            low, high = (plain(row[f"velocity_rms_over_runs_{end}_mps"], digits=4) for end in ("lo", "hi"))
            rejected = row["rejected_fraction"]
            _, at_edge = verdict_at_edge(row)
            shown.add_row(
                row["method"],
                plain(row["velocity_rms_over_runs_mps"], digits=4),
                f"{low} .. {high}",
                plain(row["attitude_rms_over_runs_deg"], digits=3, decimals=2),
                plain(row["position_rms_over_runs_m"], digits=3, decimals=2),
                plain(row["nees_mean_over_runs_and_time"], digits=2, decimals=1),
                plain(row["nees_velocity_attitude_mean_over_runs_and_time"], digits=2, decimals=1),
                "-" if rejected is None else f"{100.0 * rejected:.1f}",
                "edge" if at_edge else _SHORT[row["verdict"]],
            )
        yield shown


def recovery_tables(summary: pl.DataFrame) -> Iterator[Table]:
    """A table per trajectory: a row per method, the worst of the pairs of beams."""
    for (trajectory,), rows in worst_of_pairs(summary).group_by("trajectory", maintain_order=True):
        shown = narrow_table(
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
