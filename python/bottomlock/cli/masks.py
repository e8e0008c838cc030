"""The command `bottomlock masks`: every set of returning beams, and the recovery when lost beams return."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import polars as pl
from cyclopts import Parameter

from bottomlock.campaign.run import CampaignProgress
from bottomlock.cli.console import console, errors
from bottomlock.cli.force import ForceStudy
from bottomlock.cli.page_output import print_part, print_table
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
from bottomlock.pages.numbers import plain
from bottomlock.pages.page import Page, Table, write_pages
from bottomlock.statistics import chi_squared
from bottomlock.studies import masks as mask_study
from bottomlock.studies import recovery, study_folder, world_words
from bottomlock.studies.cases import VARYING, Case
from bottomlock.studies.masks_answer import what_was_run
from bottomlock.studies.masks_page import page, verdict_at_edge

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
        found = page(table, summary, what_was_run(loaded, command), world_words.limits(loaded))
        write_pages(out / "masks", found)
        study_folder.write_manifest(
            out, kind, configuration, status="complete",
            runs={one.name: one.campaign.runs for one in loaded}, seed={one.name: one.campaign.seed for one in loaded},
        )  # fmt: skip
    _print(table, found, chosen)
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


def _print(table: pl.DataFrame, found: Page, cases: Sequence[Case]) -> None:
    returning = {
        (case.scenario.name, case.name): mask_study.mean_beams(case)
        for case in cases
        if case.beams == VARYING
    }
    for title, shown in mask_tables(table, returning):
        print_table(title, shown)
    console.print(
        "NEES: of the whole state; NEES 6: of velocity and attitude. The last column is the verdict on NEES 6: "
        "ok (consistent), over(confident), cons(ervative), or at the edge of two of them."
    )
    for part in found.parts:
        if part.id == "recovery":
            print_part(part)
            console.print(
                f"A consistent filter fails somewhere in the whole summary in {recovery.FALSE_ALARM:.0%} of studies."
            )


def mask_tables(
    table: pl.DataFrame, returning: Mapping[tuple[str, str], float]
) -> Iterator[tuple[str, Table]]:
    """A title and a table per trajectory and case, for 80 columns; `returning`: mean beams where they vary."""
    for (trajectory, case, beams), rows in table.group_by("trajectory", "case", "beams", maintain_order=True):
        mean = returning.get((str(trajectory), str(case)))
        what = f"beams {beams}" if mean is None else f"{case} ({mean:.1f} beams per ping)"
        columns = ["method", "v m/s", "95 %", "att deg", "pos m", "NEES", "NEES 6", "rej %", ""]
        yield (
            f"{trajectory}, {what}: RMS over runs at the end",
            Table(columns, [_row(row) for row in rows.iter_rows(named=True)]),
        )


def _row(row: Mapping[str, Any]) -> list[str]:
    low, high = (plain(row[f"velocity_rms_over_runs_{end}_mps"], digits=4) for end in ("lo", "hi"))
    rejected = row["rejected_fraction"]
    _, at_edge = verdict_at_edge(row)
    return [
        row["method"],
        plain(row["velocity_rms_over_runs_mps"], digits=4),
        f"{low} .. {high}",
        plain(row["attitude_rms_over_runs_deg"], digits=3, decimals=2),
        plain(row["position_rms_over_runs_m"], digits=3, decimals=2),
        plain(row["nees_mean_over_runs_and_time"], digits=2, decimals=1),
        plain(row["nees_velocity_attitude_mean_over_runs_and_time"], digits=2, decimals=1),
        "-" if rejected is None else f"{100.0 * rejected:.1f}",
        "edge" if at_edge else _SHORT[row["verdict"]],
    ]
