"""The streaming navigator meets what the campaign's run meets, fix by fix."""

from typing import Any

import numpy as np
import pytest

from bottomlock import kernel
from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import Method
from bottomlock.simulation.build import build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tests.run_events import Readings

METHODS: list[Method] = ["lc", "tc", "vb", "elc", "vb_exact", "info", "weak_sway"]


def aided() -> Scenario:
    """Thirty seconds with every aid, so that their order counts as well."""
    scenario = load_scenario("straight").with_trajectory(duration_s=30.0)
    on = {
        name: getattr(scenario, name).model_copy(update={"enabled": True})
        for name in ("depth", "magnetometer")
    }
    gps = scenario.gps.model_copy(update={"enabled": True, "antenna_depth_m": 1e3, "acquire_s": 0.0})
    return scenario.model_copy(update=on | {"gps": gps})


def test_fixes_are_those_of_the_batch() -> None:
    """Mean NIS and the count of fixes equal the batch's, with depth, magnetometer and GPS in between."""
    simulation = build_simulation(aided())
    truth, scenario = simulation.truth(), simulation.scenario
    key = trajectory_key(scenario.name)
    plan: Any = measurement_schedule(simulation, truth, trajectory_key=key)
    model = scenario.kernel_model(simulation.gravity_mps2)
    options = scenario.kernel_options()
    arrays: Any = truth.kernel_arrays()
    batch = kernel.run_batch(
        simulation.geometry, arrays, model, model, options, plan, METHODS,
        seed=scenario.campaign.seed, trajectory_key=key, first_run=2, runs=1, threads=1,
    )  # fmt: skip
    readings = Readings(simulation, truth, run=2)
    assert len(plan["gps_time_ns"]) == 30
    for index, method in enumerate(METHODS):
        fixes = list(readings.fixes(method, readings.valid, range(30)))
        assert len(fixes) == batch["fixes_accepted"][0, index] + batch["fixes_rejected"][0, index]
        assert sum(fix.used for fix in fixes) == batch["fixes_accepted"][0, index]
        assert np.mean([fix.nis for fix in fixes]) == pytest.approx(batch["nis_mean"][0, index], rel=1e-12)
