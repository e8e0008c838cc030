"""A straight leg with fixes beside beams: what is left at its end."""

from typing import Any

import numpy as np

from bottomlock import kernel
from bottomlock.kernel import Method
from bottomlock.kernel.models import Robust
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tests.analytic import analytic_simulation
from tests.drawn_log import drawn_log
from tests.oracle.rotations import Array

METHODS: list[Method] = ["tc", "sway_current"]
SD_M = 1.0


def at_end(
    duration_s: float,
    mask: tuple[int, ...],
    has_depth: bool,
    fix_s: Array,
    off_m: Array,
    seed: int,
    runs: int,
) -> tuple[Array, Array]:
    """(runs, M) position error at the end, m, and its sigma, with fixes of `SD_M` that are off along x by `off_m`."""
    simulation = analytic_simulation("straight", duration_s=duration_s)
    truth, scenario = simulation.truth(), simulation.scenario
    model = scenario.kernel_model(simulation.gravity_mps2)
    options = scenario.kernel_options().replace(inflate_after_rejections=5, robust=Robust())
    true, schedule = truth.kernel_arrays(), dict[str, Any](measurement_schedule(simulation, truth))
    time_ns = schedule["dvl_time_ns"]
    schedule["beam_valid"] = np.ones((len(time_ns), 4), dtype=bool)
    if has_depth:
        schedule["depth_time_ns"] = time_ns[::4]
    fixed = np.searchsorted((time_ns - time_ns[0]) * 1e-9, fix_s)
    position_t_m: Any = true["position_t_m"][np.searchsorted(truth.time_ns, time_ns)]
    valid = np.broadcast_to(np.isin(np.arange(1, 5), mask), (len(time_ns), 4))
    errors, claimed = [], []
    for run in range(runs):
        drawn: Any = kernel.simulate_sensors(
            simulation.geometry, true, model, schedule,  # type: ignore[arg-type]
            seed=seed, trajectory_key=0, run=run, imu_sampling=scenario.imu.sampling, options=options,
        )  # fmt: skip
        noise = SD_M * np.random.default_rng([seed, run]).normal(size=(len(fixed), 3))
        log = drawn_log(
            drawn,
            beam_velocity_mps=np.where(valid, drawn["dvl_velocity_mps"], np.nan),
            beam_valid=valid,
            acoustic_position_time_ns=time_ns[fixed],
            acoustic_position_t_m=position_t_m[fixed] + noise + np.outer(off_m, [1.0, 0.0, 0.0]),
            acoustic_position_sd_m=np.full((len(fixed), 3), SD_M),
        )
        out = kernel.replay_log(
            simulation.geometry, model, options, METHODS, log, drawn["initial"], sample_time_ns=time_ns[-1:]
        )
        errors.append(np.linalg.norm(out["position_t_m"][:, -1] - position_t_m[-1], axis=-1))
        claimed.append(np.linalg.norm(out["sd"][:, -1, :3], axis=-1))
    return np.array(errors), np.array(claimed)
