"""The command `bottomlock sensor-law`: whether a further sensor makes an estimate worse."""

from typing import Annotated

from cyclopts import Parameter

from bottomlock.cli.console import console
from bottomlock.cli.force import ForceStudy
from bottomlock.cli.page_output import print_part
from bottomlock.cli.parameters import Recover, Seed, StudyOut, Threads, load_scenarios
from bottomlock.cli.study_output import command_line, study_bar
from bottomlock.studies import consistency as consistency_study
from bottomlock.studies import sensor_law as study
from bottomlock.studies import study_folder
from bottomlock.studies.cases import PAPER_TRAJECTORIES, beams_of
from bottomlock.studies.sensor_law_page import summary_part


def sensor_law(
    *scenario: str,
    out: StudyOut,
    runs: Annotated[int, Parameter(help="Number of runs of each cell.")] = 60,
    seed: Seed = None,
    threads: Threads = 0,
    masks: Annotated[
        str | None, Parameter(help="Sets of returning beams, such as 1234,13,1; all sets by default.")
    ] = None,
    force: ForceStudy = False,
    recover: Recover = False,
) -> None:
    """Test whether a further sensor makes an estimate worse.

    Parameters
    ----------
    scenario
        Packaged scenarios or TOML files; the three trajectories of the paper by default.
    """
    loaded = load_scenarios(
        scenario or PAPER_TRAJECTORIES, runs=runs, seed=seed, methods=None, threads=threads
    )
    sets = consistency_study.parse_masks(masks, beams_of(loaded))
    given = {"--runs": runs, "--seed": seed, "--masks": masks}
    command = command_line("sensor-law", scenario, given)
    configuration = study.configuration(loaded, sets)
    with study_folder.claimed(
        out, study.KIND, configuration, parts=study.PARTS, scenarios=loaded, force=force, recover=recover
    ):
        with study_bar(out) as report:
            table = study.run_sensor_law(
                loaded,
                sets,
                out,
                command=command,
                threads=threads,
                progress=lambda cell, done, total: report(cell, done / total),
            )
        study_folder.write_manifest(out, study.KIND, configuration, status="complete", command=command)
    print_part(summary_part(study.summary(table)))
    console.print(f"sensor_law.md and sensor_law.html in {out}")
