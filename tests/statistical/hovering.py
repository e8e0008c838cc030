"""The packaged hovering vehicle under fixed sets of beams: NEES, velocity error and claim of each method, by prior.

It holds its heading and crabs along its legs, so that it sways through the water by 0.2 m/s RMS for minutes.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import numpy as np

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.simulation.build import build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.studies import cases
from tests.oracle.rotations import Array

# Runs and seed are those of the scenario, written down before the first run.
METHODS = ("tc", "sway_current", "consistent", "weak_sway")
MASKS = ((1, 2, 3, 4), (1, 2, 3), (1, 2), (1, 4), (1, 3), (1,))
PRIORS = ("hovering", "torpedo")
EVERY_S = 5


@lru_cache(maxsize=16)
def run(mask: tuple[int, ...], vehicle: str, runs: int) -> dict[str, Array]:
    """NEES of velocity and attitude, errors and σ of velocity every 5 s; (runs, methods, T, …)."""
    scenario = load_scenario("hovering").replace({"filter.water": {"vehicle": vehicle}})
    simulation = build_simulation(cases.masked(scenario, mask))
    truth, key = simulation.truth(), trajectory_key(scenario.name)
    plan: Any = measurement_schedule(simulation, truth, trajectory_key=key)
    plan["sample_time_ns"] = plan["sample_time_ns"][plan["sample_time_ns"] % (EVERY_S * 10**9) == 0][1:]
    model, options = (
        simulation.scenario.kernel_model(simulation.gravity_mps2),
        simulation.scenario.kernel_options(),
    )
    arrays: Any = truth.kernel_arrays()
    batch: Any = kernel.run_batch(
        simulation.geometry, arrays, model, model, options, plan, METHODS,
        seed=scenario.campaign.seed, trajectory_key=key, first_run=0, runs=runs, threads=1,
    )  # fmt: skip
    return {
        "nees": batch["nees_velocity_attitude"],
        "error": batch["error"][..., 6:9],
        "sd": batch["sd"][..., 6:9],
    }


def nees(batch: dict[str, Array], method: str) -> Array:
    """Mean NEES of each run, (runs,)."""
    means: Array = batch["nees"][:, METHODS.index(method)].mean(axis=-1)
    return means


def table(runs: int, vehicles: Iterable[str] = PRIORS, masks: Iterable[tuple[int, ...]] = MASKS) -> str:
    """Beams as rows of Markdown for each prior: NEES (mean, greatest at one time), velocity RMS / claimed."""
    rows = []
    for vehicle in vehicles:
        for mask in masks:
            batch = run(mask, vehicle, runs)
            cells = []
            for k in range(len(METHODS)):
                at = batch["nees"][:, k].mean(axis=0)
                error, claimed = (
                    np.sqrt(np.mean(np.sum(batch[name][:, k] ** 2, axis=-1))) for name in ("error", "sd")
                )
                cells.append(f"{at.mean():.1f} [{at.max():.1f}], {error:.3f} / {claimed:.3f}")
            rows.append(f"| {vehicle} | {','.join(map(str, mask))} | {' | '.join(cells)} |")
    return "\n".join(rows)
