"""The consistency study: methods x masks x trajectories, NEES and NIS in chi-squared bands at one false-alarm rate.

NEES at neighbouring times of a run is nearly the same number, so a mean over time has no chi-squared band. It is judged
at a few fixed times, each against the exact band of a mean over independent runs; the bands of the whole matrix are
widened by Bonferroni's inequality, which holds for any dependence between times, methods, masks and trajectories.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel
from bottomlock.config.scenario import Scenario
from bottomlock.errors import ScenarioError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.pages.page import write_pages
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.simulation.run_events import Readings
from bottomlock.statistics import chi_squared
from bottomlock.studies import cases, study_folder, world_words
from bottomlock.studies.consistency_page import page
from bottomlock.tables.studies import CONSISTENCY_CELL, CONSISTENCY_STUDY

KIND = "consistency"
PARTS = ("cells", "consistency.parquet", "consistency.md", "consistency.html", study_folder.MANIFEST)
FALSE_ALARM = 0.01
TIMES = 5
BLIND = ("ins", "lc")
"""Methods whose beams do not depend on the mask: judged once, with all beams."""


def parse_masks(text: str | None, beams: int) -> list[tuple[int, ...]]:
    """Masks from `1234,12,1`; every one for None.

    Raises:
        ScenarioError: for what is not a set of beams of the instrument.

    Examples:
        >>> parse_masks("1234,13", 4)
        [(1, 2, 3, 4), (1, 3)]
    """
    if text is None:
        return cases.masks(beams)
    known = {"".join(map(str, mask)): mask for mask in cases.masks(beams)}
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    for name in names:
        if name not in known:
            raise ScenarioError(
                f"'{name}' is no set of the beams 1 to {beams}, expected digits in rising order, such as 12"
            )
    if not names:
        raise ScenarioError("no mask is named")
    return [known[name] for name in names]


def configuration(scenarios: Sequence[Scenario], masks: Sequence[tuple[int, ...]]) -> str:
    """Hash of the settings that determine the consistency study."""
    content = [
        (s.name, build_simulation(s).fingerprint(), list(s.campaign.methods), s.campaign.runs)
        for s in scenarios
    ]
    return study_folder.configuration_hash([content, [list(mask) for mask in masks], TIMES, FALSE_ALARM])


def run_consistency(
    scenarios: Sequence[Scenario],
    masks: Sequence[tuple[int, ...]],
    out: str | Path,
    *,
    command: str = "",
    threads: int = 0,
    progress: Callable[[str, int, int], None] = lambda _cell, _done, _total: None,
) -> pl.DataFrame:
    """Runs the matrix and writes `consistency.parquet`, `.md` and `.html`; finished cells in `out` are kept.

    Args:
        scenarios: trajectories of different names, with runs, seed and methods.
        masks: sets of returning beams, as `cases.masks` gives them.
        out: directory, claimed by the caller (`study_folder.claimed`).
        command: the command that reproduces the study, for the text.
        threads: 0 for as many as there are cores. The numbers do not depend on it.
        progress: called after each cell with its name, the number of finished cells and of all cells.

    Returns:
        The table `tables.studies.CONSISTENCY_STUDY`.

    Raises:
        ScenarioError: for a scenario or mask that is not valid.
        OutputError: if `out` cannot be written.
        KernelError: for input that the kernel rejects, naming run and method.
    """
    out = Path(out)
    parts = []
    total = len(scenarios) * len(masks)
    hashed = configuration(scenarios, masks)
    for scenario in scenarios:
        for mask in masks:
            case = cases.masked(scenario, mask)
            path = out / "cells" / f"{scenario.name}-{case.name}.parquet"
            whole = len(mask) == scenario.dvl.beams
            cell = partial(run_cell, case, whole=whole, threads=threads)
            parts.append(study_folder.finished_part(path, hashed, cell))
            progress(f"{scenario.name} {case.name}", len(parts), total)
    means = pl.concat(parts)
    table = judge(means)
    first = scenarios[0]
    facts: dict[str, Any] = {
        "trajectories": [scenario.name for scenario in scenarios],
        "methods": list(first.campaign.methods),
        "beams": [cases.beam_list(mask) for mask in masks],
        "seed": study_folder.campaign_values(scenarios, "seed"),
        "times_s": [f"{time_s:g}" for time_s in means["time_s"].drop_nulls().unique().sort()],
        "degrees": first.filter.states,
        "tests": means.height,
        "false_alarm": FALSE_ALARM,
        "each_probability": chi_squared.each_probability(FALSE_ALARM, means.height),
        "settings": world_words.settings(scenarios),
        "limits": world_words.limits(scenarios),
        "versions": study_folder.versions(),
        "configuration_hash": hashed,
        "command": command,
    }
    write_parquet(out / "consistency.parquet", table)
    write_pages(out / "consistency", page(table, facts))
    return table


def judged_times_s(duration_s: float) -> list[float]:
    """Times at which NEES is judged: the ends of equal parts of the duration, at full seconds.

    >>> judged_times_s(250.0)
    [50.0, 100.0, 150.0, 200.0, 250.0]
    """
    times = {float(int(duration_s * (k + 1) / TIMES)) for k in range(TIMES)}
    return sorted(time_s for time_s in times if time_s >= 1.0)


def run_judged(
    simulation: Simulation, methods: Sequence[str], *, threads: int = 0
) -> tuple[list[float], dict[str, Any]]:
    """The times (s) at which NEES is judged, and the kernel's batch of the scenario's runs sampled at these times."""
    scenario, truth = simulation.scenario, simulation.truth()
    key = trajectory_key(scenario.name)
    plan: Any = measurement_schedule(simulation, truth, trajectory_key=key)
    times_s = judged_times_s((plan["sample_time_ns"][-1] - truth.time_ns[0]) * 1e-9)
    plan["sample_time_ns"] = truth.time_ns[0] + np.array([round(time_s * 1e9) for time_s in times_s])
    model, options = scenario.kernel_model(simulation.gravity_mps2), scenario.kernel_options()
    arrays: Any = truth.kernel_arrays()
    batch: Any = kernel.run_batch(
        simulation.geometry, arrays, model, model, options, plan, list(methods),
        seed=scenario.campaign.seed, trajectory_key=key, first_run=0, runs=scenario.campaign.runs, threads=threads,
    )  # fmt: skip
    return times_s, batch


def run_cell(case: cases.Case, *, whole: bool, threads: int = 0) -> pl.DataFrame:
    """Every method under one mask on one trajectory: the means to be judged."""
    simulation = build_simulation(case.scenario)
    scenario, runs = simulation.scenario, simulation.scenario.campaign.runs
    methods = [method for method in scenario.campaign.methods if whole or method not in BLIND]
    if not methods:
        return pl.DataFrame(schema=dict(CONSISTENCY_CELL))
    times_s, batch = run_judged(simulation, methods, threads=threads)
    rows_fused = _rows_fused(simulation, methods)
    full = scenario.filter.states
    rows: list[tuple[Any, ...]] = []
    for index, method in enumerate(methods):
        place = (scenario.name, case.beams, method)
        for quantity, degrees in (("nees_velocity_attitude", 6), ("nees", full)):
            values = batch[quantity][:, index].mean(axis=0)
            rows += [
                (*place, quantity, time_s, degrees, runs, runs, float(mean))
                for time_s, mean in zip(times_s, values, strict=True)
            ]
        fixes = int(batch["fixes_accepted"][:, index].sum() + batch["fixes_rejected"][:, index].sum())
        if fixes and rows_fused[method]:
            # Every run has the same number of fixes under a mask that stays, so the mean of means is the mean.
            mean = float(batch["nis_mean"][:, index].mean())
            rows.append((*place, "nis", None, rows_fused[method], runs, fixes, mean))
    return pl.DataFrame(rows, schema=dict(CONSISTENCY_CELL), orient="row")


def _rows_fused(simulation: Simulation, methods: Sequence[str]) -> dict[str, float]:
    """Rows that each method fuses per fix under the scenario's mask, from its first run; 0 without fixes."""
    readings = Readings(simulation, simulation.truth(), run=0)
    pings = range(len(readings.ping_time_ns))
    degrees = {
        method: [fix.degrees for fix in readings.fixes(method, readings.valid, pings)] for method in methods
    }
    return {method: float(np.mean(found)) if found else 0.0 for method, found in degrees.items()}


def judge(means: pl.DataFrame) -> pl.DataFrame:
    """The table `tables.studies.CONSISTENCY_STUDY` from the means of all cells: as many tests as there are means."""
    each = chi_squared.each_probability(FALSE_ALARM, means.height)
    keys = ["trajectory", "beams", "method", "quantity", "degrees", "runs", "values"]
    rows = []
    for key, group in means.group_by(keys, maintain_order=True):
        *_, degrees, _, values = key
        low, high = chi_squared.mean_band(float(degrees), int(values), each)
        found = group["mean"].to_numpy()
        least, greatest = float(found.min()), float(found.max())
        rows.append(
            (
                *key,
                float(found.mean()),
                least,
                greatest,
                low,
                high,
                chi_squared.verdict(low, least, greatest, high),
            )
        )
    return pl.DataFrame(rows, schema=dict(CONSISTENCY_STUDY), orient="row")
