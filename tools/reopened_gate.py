"""Prints the table of decision 0018: what a gate that reopens is worth to filters that start worse than they claim.

`python tools/reopened_gate.py`: 100 runs of the vehicle's straight line, seed 2017, for each initial tilt and gate.
"""

from typing import Any

import numpy as np

import bottomlock
from bottomlock.kernel import Method
from bottomlock.simulation.build import trajectory_key

RUNS, SEED = 100, 2017
METHODS: tuple[Method, ...] = ("lc", "sway_current")


def run_with_tilt(tilt_factor: float, reopen_fixes: int) -> dict[str, Any]:
    """Runs whose initial misalignment is `tilt_factor` times what the filters assume."""
    scenario = bottomlock.load_scenario("straight")
    simulation = bottomlock.build_simulation(scenario)
    truth = simulation.truth()
    assumed = scenario.kernel_model(simulation.gravity_mps2)
    tilted = assumed.initial.replace(
        attitude_sd_rad=[tilt_factor * sd for sd in assumed.initial.attitude_sd_rad]
    )
    options = scenario.kernel_options().replace(inflate_after_rejections=reopen_fixes)
    arrays: Any = truth.kernel_arrays()
    schedule: Any = bottomlock.measurement_schedule(simulation, truth)
    return dict(
        bottomlock.run_batch(
            simulation.geometry, arrays, assumed.replace(initial=tilted), assumed, options, schedule, METHODS,
            seed=SEED, trajectory_key=trajectory_key("straight"), first_run=0, runs=RUNS, threads=0,
        )
    )  # fmt: skip


def main() -> None:
    """Prints a row for each tilt and gate."""
    print("tilt  reopens after  " + "  ".join(f"{method}: locked out, m/s at the end" for method in METHODS))
    for tilt_factor in (1.0, 2.0, 4.0):
        for reopen_fixes in (0, 5):
            batch = run_with_tilt(tilt_factor, reopen_fixes)
            lost = (batch["fixes_rejected"] > batch["fixes_accepted"]).sum(axis=0)
            squares = (batch["error"][:, :, -1, 6:9] ** 2).sum(axis=-1)
            rms = np.sqrt(squares.mean(axis=0))
            cells = "  ".join(f"{count} {speed:.3g}" for count, speed in zip(lost, rms, strict=True))
            print(f"{tilt_factor:g}  {reopen_fixes}  {cells}")


if __name__ == "__main__":
    main()
