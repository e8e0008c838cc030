"""The whole of the 2017 study: campaign, the same runs without the causes that the paper gives, sweep, report."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bottomlock.campaign.run import CampaignProgress, check_campaign, run_campaign
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.files.output_folder import locked
from bottomlock.files.records import write_recorded_table
from bottomlock.report.page import Report, make_report
from bottomlock.studies.cases import PAPER_TRAJECTORIES
from bottomlock.studies.sweep import run_sweep, sweep_cells
from bottomlock.studies.without_cause import run_without_causes, variants

RUNS = 500


def sweep_runs(runs: int) -> int:
    """Runs of each cell of the sweep: a tenth of the campaign's, within 10 to 50.

    >>> sweep_runs(50), sweep_runs(500)
    (10, 50)
    """
    return min(50, max(10, runs // 10))


def reproduce(
    out: str | Path,
    *,
    runs: int = RUNS,
    seed: int | None = None,
    methods: Sequence[str] | None = None,
    threads: int = 0,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> Report:
    """Flies the three trajectories with every method, sweeps what the paper leaves open, and writes the report.

    An interrupted study resumes, its sweep from the start; the numbers do not depend on interruptions or threads.

    Args:
        out: directory; new, empty, or of the same study.
        runs: runs of each trajectory.
        seed: seed of all; the scenarios' own by default.
        methods: methods; the scenarios' own by default.
        threads: 0 for as many as there are cores.
        force: start over in a directory of another study.
        progress: called with the progress of the campaign, of the runs without a cause, then of the sweep.

    Raises:
        As `run_campaign` and `make_report`.
    """
    out = Path(out)
    scenarios = study_scenarios(runs, seed, methods)
    settings: Any = {"threads": threads, "force": force, "progress": progress}
    check_campaign(scenarios, out, force=force)
    # Held from the first campaign to the report.
    with locked(out):
        manifest = run_campaign(scenarios, out, **settings).manifest
        run_without_causes(scenarios, out, **settings)
        sweep = run_sweep(scenarios, runs=sweep_runs(runs), threads=threads, progress=progress)
        identity = {"configuration_hash": manifest["configuration_hash"]}
        write_recorded_table(out / "sweep.parquet", sweep, identity)
        return make_report(out, force=force)


def study_scenarios(
    runs: int, seed: int | None = None, methods: Sequence[str] | None = None
) -> list[Scenario]:
    """The three trajectories of the study, with the scenarios' own seed and methods by default."""
    return [
        load_scenario(name).with_overrides(runs=runs, seed=seed, methods=methods)
        for name in PAPER_TRAJECTORIES
    ]


def study_runs(runs: int) -> int:
    """Total of the progress of a study, with the methods of the scenarios."""
    again = sum(len(changed) for changed in variants(study_scenarios(runs, None, None)).values())
    return again * runs + len(PAPER_TRAJECTORIES) * (runs + sweep_cells() * sweep_runs(runs))
