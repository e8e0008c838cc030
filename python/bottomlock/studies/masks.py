"""Performance of each method with every partial mask, on the same runs.

One campaign per case (a mask from first to last, dropouts by chance, loss over a slope) in a folder of its own, all
with the scenarios' own names and therefore the same random streams, so differences between cases are paired.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import polars as pl

from bottomlock.campaign.run import CampaignProgress, run_campaign
from bottomlock.config.scenario import Scenario
from bottomlock.errors import ScenarioError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.simulation.build import build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.statistics import campaign
from bottomlock.studies import cases, study_folder
from bottomlock.support.nearest import did_you_mean
from bottomlock.tables.studies import MASKS

KIND = "masks"
PARTS = (
    "cases",
    "recovery",
    "masks.parquet",
    "recovery.parquet",
    "recovery_summary.parquet",
    "masks.md",
    "masks.html",
    study_folder.MANIFEST,
)


def all_cases(scenario: Scenario) -> list[cases.Case]:
    """Every beam, every partial mask, dropouts and the slope, in this order.

    Raises:
        ScenarioError: for an instrument of one beam, and for what `build_simulation` rejects.
    """
    beams = scenario.dvl.beams
    if beams < 2:
        raise ScenarioError(f"scenario {scenario.name}: an instrument of one beam has no partial masks")
    start_m = float(build_simulation(cases.masked(scenario, (1,)).scenario).truth().position_t_m[0, 2])
    fixed = [cases.masked(scenario, mask) for mask in cases.masks(beams)]
    return [*fixed, cases.dropouts(scenario), cases.over_slope(scenario, start_m)]


def select(found: Sequence[cases.Case], wanted: Sequence[str] | None) -> list[cases.Case]:
    """The cases whose names are wanted, `beams_12` or plainly `12`; all of them for None.

    Raises:
        ScenarioError: for a name that no case has.
    """
    if wanted is None:
        return list(found)
    known = {case.name: case for case in found}
    chosen = []
    for name in dict.fromkeys(wanted):
        case = known.get(name) or known.get(f"beams_{name}")
        if case is None:
            names = [key.removeprefix("beams_") for key in known]
            # Sets of beams are numbers: none is a slip of another.
            hint = did_you_mean(name, [one for one in names if not one.isdigit()])
            raise ScenarioError(f"unknown case '{name}'{hint} (known: {', '.join(names)})")
        chosen.append(case)
    if not chosen:
        raise ScenarioError("no case is named")
    return chosen


def configuration(scenarios: Sequence[Scenario]) -> str:
    """Hash of the settings that determine a study's numbers, except the number of runs and the choice of cases."""
    simulations = [build_simulation(scenario) for scenario in scenarios]
    return study_folder.configuration_hash(
        [(w.scenario.name, w.fingerprint(), list(w.scenario.campaign.methods)) for w in simulations]
    )


def mean_beams(case: cases.Case) -> float:
    """Mean number of valid beams per ping over time and runs."""
    simulation = build_simulation(case.scenario)
    plan = measurement_schedule(
        simulation,
        simulation.truth(),
        trajectory_key=trajectory_key(case.scenario.name),
        runs=case.scenario.campaign.runs,
    )
    return float(plan["beam_valid"].sum(axis=-1).mean())


def run_masks(
    scenarios: Sequence[Scenario],
    out: str | Path,
    *,
    wanted: Sequence[str] | None = None,
    threads: int = 0,
    recover: bool = False,
    progress: Callable[[str, CampaignProgress], None] = lambda _case, _progress: None,
) -> pl.DataFrame:
    """Runs the cases and writes `masks.parquet` to `out`; finished chunks there are kept.

    Args:
        scenarios: trajectories of different names; their own rules of beam loss are replaced, and their vehicles are
            steered on the truth.
        out: directory, claimed by the caller (`study_folder.claimed`).
        wanted: names of cases; all for None.
        threads: 0 for as many as there are cores.
        recover: go on where a campaign's manifest is damaged, as for `run_campaign`.
        progress: called with the case and the progress of its campaign.

    Returns:
        The table `tables.studies.MASKS`.

    Raises:
        ScenarioError: for scenarios of one name, instruments of different beams, and unknown cases.
        OutputError: if `out` cannot be written.
        KernelError: for input that the kernel rejects, naming run and method.
    """
    out = Path(out)
    cases.beams_of(scenarios)
    by_scenario = [select(all_cases(scenario), wanted) for scenario in scenarios]
    parts = []
    for same in zip(*by_scenario, strict=True):
        case = same[0]

        def report(state: CampaignProgress, name: str = case.name) -> None:
            progress(name, state)

        results = run_campaign(
            [one.scenario for one in same],
            out / "cases" / case.name,
            threads=threads,
            recover=recover,
            progress=report,
        )
        parts.append(gather(case, results.runs, results.ensemble, results.consistency))
    by_case = pl.concat(parts)
    table = pl.concat([by_case.filter(pl.col("trajectory") == scenario.name) for scenario in scenarios])
    write_parquet(out / "masks.parquet", table)
    return table


def gather(
    case: cases.Case, runs: pl.DataFrame, ensemble: pl.DataFrame, consistency: pl.DataFrame
) -> pl.DataFrame:
    """The rows of one case from the tables of its campaign."""
    of_interest = consistency.filter(pl.col("quantity") == "nees_velocity_attitude").select(
        "trajectory",
        "method",
        pl.col("mean").alias("nees_velocity_attitude_mean_over_runs_and_time"),
        "verdict",
    )
    errors = pl.col("velocity_final_mps")
    scatter = runs.group_by("trajectory", "method").agg(
        pl.len().cast(pl.Int64).alias("runs"),
        errors.median().alias("velocity_median_mps"),
        ((errors**2).max() / (errors**2).sum()).alias("velocity_greatest_share"),
    )
    return (
        campaign.summary_table(ensemble, runs)
        .join(scatter, on=["trajectory", "method"], how="left", maintain_order="left")
        .join(of_interest, on=["trajectory", "method"], how="left", maintain_order="left")
        .with_columns(
            pl.lit(case.name).alias("case"),
            pl.lit(case.beams).alias("beams"),
            pl.col("rejected_fraction").fill_nan(None),
        )
        .select(list(MASKS))
    )
