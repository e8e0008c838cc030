"""Fixes that come back after four minutes with one beam or a diagonal pair are taken, however far the estimate is.

By then the open direction of the velocity can be wrong by tens of m/s and the position by kilometres. Nothing but the
fixes shows it: from five that are rejected in a row the filter learns that its velocity is wrong, not its position
alone. Where it did not, one run in 30 to 60 of a diagonal pair ended 20 to 170 m off, one in 300 of one beam by
kilometres.
"""

from typing import Any

import numpy as np
import pytest

from bottomlock import kernel
from bottomlock.kernel import Method
from bottomlock.kernel.models import Robust
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tests.analytic import analytic_simulation
from tests.drawn_log import drawn_log
from tests.oracle.rotations import Array

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

SEED, RUNS = 20261130, 60
METHODS: list[Method] = ["tc", "sway_current"]
DURATION_S, BEGIN_S, EVERY_S, SD_M = 340.0, 240.0, 5, 1.0


def last_errors(mask: tuple[int, ...], has_depth: bool, seed: int, runs: int) -> Array:
    """(runs, M) error of the position at the end, m, of a straight leg with fixes from `BEGIN_S` on."""
    simulation = analytic_simulation("straight", duration_s=DURATION_S)
    truth, scenario = simulation.truth(), simulation.scenario
    model = scenario.kernel_model(simulation.gravity_mps2)
    options = scenario.kernel_options().replace(inflate_after_rejections=5, robust=Robust())
    true, schedule = truth.kernel_arrays(), dict[str, Any](measurement_schedule(simulation, truth))
    time_ns = schedule["dvl_time_ns"]
    schedule["beam_valid"] = np.ones((len(time_ns), 4), dtype=bool)
    if has_depth:
        schedule["depth_time_ns"] = time_ns[::4]
    position_t_m: Any = true["position_t_m"][np.searchsorted(truth.time_ns, time_ns)]
    fixed = np.flatnonzero((time_ns - time_ns[0]) * 1e-9 >= BEGIN_S)[::EVERY_S]
    valid = np.broadcast_to(np.isin(np.arange(1, 5), mask), (len(time_ns), 4))
    errors = []
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
            acoustic_position_t_m=position_t_m[fixed] + noise,
            acoustic_position_sd_m=np.full((len(fixed), 3), SD_M),
        )
        out = kernel.replay_log(
            simulation.geometry, model, options, METHODS, log, drawn["initial"], sample_time_ns=time_ns[-1:]
        )
        errors.append(np.linalg.norm(out["position_t_m"][:, -1] - position_t_m[-1], axis=-1))
    return np.array(errors)


@pytest.mark.parametrize("mask", [pytest.param((1,), marks=pytest.mark.long), (1, 3), (2, 4)])
@pytest.mark.parametrize("has_depth", [False, True])
def test_fixes_are_taken_again(mask: tuple[int, ...], has_depth: bool) -> None:
    """After twenty fixes of 1 m no run ends beyond 6 m, and half of them within 1.5 m."""
    errors = last_errors(mask, has_depth, SEED, RUNS)
    assert errors.max() < 6.0, errors.max(axis=0)
    assert (np.median(errors, axis=0) < 1.5).all()
