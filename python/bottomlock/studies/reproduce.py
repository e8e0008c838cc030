"""The whole of the 2017 study: campaign, the same runs without the causes that the paper gives, sweep, report.

Runs without a cause have the same sensor errors and last as long as the drift, so they cost a small part of the
campaign.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl

from bottomlock.campaign.run import CampaignProgress, check_campaign, run_campaign
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.files.columns import CURRENT, SWEEP, VIRTUAL_BEAM_FACTOR
from bottomlock.files.output_folder import locked
from bottomlock.files.records import write_recorded_table
from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.report.page import Report, make_report
from bottomlock.statistics.claims import CauseClaim, load_paper
from bottomlock.studies.cases import PAPER_TRAJECTORIES


@dataclass(frozen=True)
class Setting:
    """A setting with its values and the methods that depend on it."""

    parameter: str
    values: tuple[float | str, ...]
    methods: tuple[str, ...]
    change: Callable[[Scenario, Any], Scenario]


def _filter(key: str) -> Callable[[Scenario, Any], Scenario]:
    def change(scenario: Scenario, value: float | str) -> Scenario:
        return scenario.model_copy(update={"filter": scenario.filter.model_copy(update={key: value})})

    return change


def _initial_attitude(scenario: Scenario, factor: float) -> Scenario:
    initial = scenario.initial
    scaled = {key: factor * getattr(initial, key) for key in ("roll_deg", "pitch_deg", "yaw_deg")}
    return scenario.model_copy(update={"initial": initial.model_copy(update=scaled)})


def _cross_current(scenario: Scenario, speed_mps: float) -> Scenario:
    current = {"speed_mps": speed_mps, "towards_deg": 90.0}
    return scenario.replace({"mission.current": current})


SETTINGS = (
    Setting(VIRTUAL_BEAM_FACTOR, (1.0, 3.0, 6.0, 10.0, 30.0), ("vb",), _filter("virtual_beam_factor")),
    Setting(
        "ε of NSV, m²/s²", (1e-6, 1e-4, 1e-3, 1e-2, 1.0), ("nsv", "elc"), _filter("nullified_sway_var_m2ps2")
    ),
    Setting("gate", ("joint", "per_row", "off"), ("tc", "vb", "nsv", "vhv", "elc"), _filter("gate")),
    Setting(
        "inflate after rejections",
        (0, 5),
        ("lc", "tc", "vb", "nsv", "vhv", "elc", RECOMMENDED_METHOD),
        _filter("inflate_after_rejections"),
    ),
    Setting(
        "initial attitude, times Table 2", (0.5, 1.0, 2.0), ("ins", "tc", "nsv", "plcf"), _initial_attitude
    ),
    Setting(CURRENT, (0.0, 0.1, 0.3), ("tc", "nsv", "elc", "weak_sway"), _cross_current),
)
"""n_f, ε, gate, initial covariance and, by a current, sway."""


def run_sweep(
    scenarios: Sequence[Scenario],
    *,
    runs: int,
    threads: int = 0,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> pl.DataFrame:
    """Runs every value of every setting on scenarios with a vehicle, with the same sensor errors for all.

    Returns:
        `files.columns.SWEEP`: RMS over runs at the end, mean NEES, rejected fraction of the fixes.

    Raises:
        As `run_campaign`.
    """

    def part(name: str, setting: Setting, value: float | str) -> pl.DataFrame:
        changed = [setting.change(scenario, value) for scenario in scenarios]
        results = run_campaign(
            changed,
            runs=runs,
            methods=setting.methods,
            threads=threads,
            progress=lambda state: progress(replace(state, trajectory=f"sweep {name} {state.trajectory}")),
        )
        return _rows(setting.parameter, value, results.summary)

    return pl.concat(
        part(f"{number}-{value}", setting, value)
        for number, setting in enumerate(SETTINGS, start=1)
        for value in setting.values
    )


def _rows(parameter: str, value: float | str, summary: pl.DataFrame) -> pl.DataFrame:
    label = value if isinstance(value, str) else f"{value:g}"
    return summary.with_columns(
        pl.lit(parameter).alias("parameter"),
        pl.lit(label).alias("value"),
        pl.col("rejected_fraction").fill_nan(None),
    ).select(list(SWEEP))


def sweep_cells() -> int:
    """Number of values of a sweep."""
    return sum(len(setting.values) for setting in SETTINGS)


CHANGES = {"dive": {"dive_rate_mps": 0.0}}
"""Keys of `[mission]` without each cause."""


def variants(scenarios: Sequence[Scenario]) -> dict[str, list[Scenario]]:
    """For each cause in the paper's claims the scenarios without it, with the methods of the claims alone.

    A scenario without a claim on a cause, or without its methods, has no variant.

    >>> from bottomlock.config.scenario import load_scenario
    >>> (level,) = variants([load_scenario("straight"), load_scenario("lawn_mower")])["dive"]
    >>> level.name, level.trajectory.duration_s, level.mission.dive_rate_mps, level.campaign.methods
    ('lawn_mower', 30.0, 0.0, ('vb', 'plcf'))
    """
    claims = [claim for claim in load_paper().claim if isinstance(claim, CauseClaim)]
    changed: dict[str, list[Scenario]] = {}
    for cause, change in CHANGES.items():
        for scenario in scenarios:
            here = [
                claim
                for claim in claims
                if (claim.without, claim.trajectory) == (cause, scenario.name)
                and claim.method in scenario.campaign.methods
            ]
            if here:
                end_s = max(claim.window_s[1] for claim in here)
                short = scenario.with_trajectory(duration_s=end_s)
                short = short.with_overrides(methods=[claim.method for claim in here])
                level = short.replace({f"mission.{key}": value for key, value in change.items()})
                changed.setdefault(cause, []).append(level)
    return changed


def run_without_causes(
    scenarios: Sequence[Scenario],
    out: str | Path,
    *,
    threads: int = 0,
    force: bool = False,
    progress: Callable[[CampaignProgress], None] = lambda _: None,
) -> None:
    """Runs the variants, a campaign `without_CAUSE` in `out` for each cause; finished ones are kept.

    Raises:
        As `run_campaign`.
    """
    out = Path(out)
    for cause, changed in variants(scenarios).items():
        run_campaign(
            changed,
            out / f"without_{cause}",
            threads=threads,
            force=force,
            progress=lambda state, cause=cause: progress(  # type: ignore[misc]
                replace(state, trajectory=f"{state.trajectory} without {cause}")
            ),
        )


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
