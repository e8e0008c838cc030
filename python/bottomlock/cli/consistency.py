"""The command `bottomlock consistency`: NEES and NIS of every method, set of beams and trajectory."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import polars as pl
from cyclopts import Parameter

from bottomlock.cli.console import EXIT_DEPARTURE, console, errors
from bottomlock.cli.force import ForceStudy
from bottomlock.cli.page_output import print_part
from bottomlock.cli.parameters import Methods, Recover, Seed, StudyOut, Threads, World, load_scenarios
from bottomlock.cli.study_output import command_line, study_bar
from bottomlock.config.scenario import Scenario
from bottomlock.studies import consistency as consistency_study
from bottomlock.studies import study_folder
from bottomlock.studies.cases import PAPER_TRAJECTORIES, beam_list, beams_of
from bottomlock.studies.consistency_page import methods_part
from bottomlock.studies.expected_verdicts import Expectation, check_names, departures, read_expectations

Expectations = tuple[Expectation, ...]


def consistency(
    *scenario: str,
    out: StudyOut,
    runs: Annotated[int, Parameter(alias="-n", help="Number of runs of each cell.")] = 100,
    seed: Seed = None,
    threads: Threads = 0,
    methods: Methods = None,
    world: World = None,
    masks: Annotated[
        str | None, Parameter(help="Sets of returning beams, such as 1234,123,12; all sets by default.")
    ] = None,
    asserted: Annotated[
        Path | None,
        Parameter(name="--assert", help="TOML file of expected verdicts; exit code 1 if one differs."),
    ] = None,
    force: ForceStudy = False,
    recover: Recover = False,
) -> None:
    """Test the consistency of NEES and NIS for every method and set of beams.

    Parameters
    ----------
    scenario
        Packaged scenarios or TOML files; the three trajectories of the paper by default.
    """
    expected = None if asserted is None else read_expectations(asserted)
    loaded = load_scenarios(
        scenario or PAPER_TRAJECTORIES, runs=runs, seed=seed, methods=methods, threads=threads, world=world
    )
    sets = consistency_study.parse_masks(masks, beams_of(loaded))
    if expected is not None:
        _check_expected(expected, loaded, sets)
    given = {"--world": world, "--runs": runs, "--seed": seed, "--methods": methods, "--masks": masks}
    command = command_line("consistency", scenario, given)
    configuration = consistency_study.configuration(loaded, sets)
    kind, parts = consistency_study.KIND, consistency_study.PARTS
    with study_folder.claimed(
        out, kind, configuration, parts=parts, scenarios=loaded, force=force, recover=recover
    ):
        with study_bar(out) as report:
            table = consistency_study.run_consistency(
                loaded,
                sets,
                out,
                command=command,
                threads=threads,
                progress=lambda cell, done, total: report(cell, done / total),
            )
        study_folder.write_manifest(out, kind, configuration, status="complete", command=command)
    _print(table, out)
    if expected is not None:
        _compare(table, expected)


def _check_expected(
    expected: Expectations, scenarios: Sequence[Scenario], sets: Sequence[tuple[int, ...]]
) -> None:
    """Rejects an expected verdict on what the study does not hold, before anything is run."""
    check_names(
        expected,
        methods={method for one in scenarios for method in one.campaign.methods},
        trajectories={one.name for one in scenarios},
        beams={beam_list(mask) for mask in sets},
    )


def _print(table: pl.DataFrame, out: Path) -> None:
    print_part(methods_part(table))
    console.print(
        f"false-alarm rate of the whole study: {consistency_study.FALSE_ALARM:.0%}; consistency.md in {out}"
    )


def _compare(table: pl.DataFrame, expected: Expectations) -> None:
    """Ends the command with exit code 1 where a verdict differs from the expected one."""
    found = departures(table, expected)
    for line in found:
        errors.print(f"bottomlock: {line}")
    if found:
        sys.exit(EXIT_DEPARTURE)
    console.print("every verdict is as expected")
