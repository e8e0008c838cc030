"""The batched JAX filter against the kernel, on one straight path of Table 2: time for one inertial step of one run.

    python -m benches.rivals.jax_speed [--runs 1,16,64] [--seconds 60] [--rounds 5]

Every round times every candidate, in turn; a figure is the median over the rounds with the smallest and the largest, a
ratio the median of the rounds' own. Wall time: both use every core. The kernel simulates the readings too, which JAX is
given; it is timed with the covariance at every step, as JAX does it, and at 10 Hz, its default. JAX is timed after its
compilation, whose seconds stand beside.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from benches.rivals import jax_ekf
from benches.rivals.scenario_missions import scenario_mission
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import run_batch
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule

Candidate = Callable[[], Any]


def main() -> None:
    """Prints a line for each number of runs."""
    parser = argparse.ArgumentParser(description="The batched JAX filter against the kernel.")
    parser.add_argument("--runs", default="1,16,64", help="numbers of runs beside each other")
    parser.add_argument("--seconds", type=float, default=60.0, help="length of a run")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    scenario = load_scenario("straight").with_trajectory(duration_s=arguments.seconds)
    scenario = scenario.replace({"imu.sampling": "averaged", "filter.gate": "off"})
    simulation = build_simulation(scenario)
    steps = len(simulation.truth().time_ns) - 1
    for runs in (int(word) for word in arguments.runs.split(",")):
        batch = jax_ekf.batch_of([scenario_mission(scenario, k, simulation=simulation) for k in range(runs)])
        began = time.perf_counter()
        jax.block_until_ready(jax_ekf.run(batch))
        compiled_s = time.perf_counter() - began
        candidates: dict[str, Candidate] = {
            "JAX": lambda batch=batch: jax.block_until_ready(jax_ekf.run(batch)),
            "kernel, every step": kernel(scenario, simulation, runs, 0.0),
            "kernel, 10 Hz": kernel(scenario, simulation, runs, 10.0),
        }
        seconds = timed(candidates, arguments.rounds)
        print(f"{runs} runs of {steps} steps; JAX compiled in {compiled_s:.1f} s")
        for name, times in seconds.items():
            each = times / (runs * steps) * 1e6
            ratio = np.median(seconds["JAX"] / times)
            spread = f"{each.min():.3f}–{each.max():.3f}"
            print(
                f"  {name:20} {np.median(each):8.3f} µs a step ({spread}); JAX takes {ratio:.1f} times as long"
            )


def kernel(scenario: Scenario, simulation: Simulation, runs: int, rate_hz: float) -> Candidate:
    """Tight coupling by `run_batch`, sensors included, with the covariance at a rate; 0 at every step."""
    chosen = scenario.replace({"filter.covariance_rate_hz": rate_hz})
    truth, key = simulation.truth(), trajectory_key(scenario.name)
    schedule: Any = measurement_schedule(simulation, truth, trajectory_key=key, first_run=0, runs=runs)
    arrays: Any = truth.kernel_arrays()
    model, options = chosen.kernel_model(simulation.gravity_mps2), chosen.kernel_options()
    return lambda: run_batch(
        simulation.geometry, arrays, model, model, options, schedule, ["tc"],
        seed=scenario.campaign.seed, trajectory_key=key, first_run=0, runs=runs, threads=0,
    )  # fmt: skip


def timed(candidates: dict[str, Candidate], rounds: int) -> dict[str, Any]:
    """Seconds of each candidate in each round, after one that is not counted."""
    seconds: dict[str, list[float]] = {name: [] for name in candidates}
    for number in range(rounds + 1):
        for name, call in candidates.items():
            began = time.perf_counter()
            call()
            if number:
                seconds[name].append(time.perf_counter() - began)
    return {name: np.array(times) for name, times in seconds.items()}


if __name__ == "__main__":
    main()
