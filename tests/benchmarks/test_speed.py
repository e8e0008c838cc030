"""What Python sees: timed by `make bench`, run once as a test elsewhere; compare by ratio within one run."""

from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from bottomlock import kernel
from bottomlock.campaign import geometry_of, gravity_of
from bottomlock.scenario import load_scenario
from bottomlock.sensors import schedule
from bottomlock.trajectory import make_truth


@pytest.fixture(scope="module")
def flight() -> dict[str, Any]:
    """Ten seconds of the straight trajectory."""
    scenario = load_scenario("straight")
    scenario = scenario.model_copy(
        update={"trajectory": scenario.trajectory.model_copy(update={"duration_s": 10.0})}
    )
    gravity = gravity_of(scenario)
    truth, model = make_truth(scenario, gravity), scenario.kernel_model(gravity)
    return {
        "geometry": geometry_of(scenario), "truth": truth.kernel_arrays(), "simulated": model, "assumed": model,
        "options": scenario.kernel_options(), "schedule": schedule(scenario, truth), "seed": 1, "trajectory_key": 2,
        "first_run": 0,
    }  # fmt: skip


@pytest.mark.parametrize("arm", ["ins", "lc", "tc", "elc"])
def test_batch_of_one_arm(benchmark: BenchmarkFixture, flight: dict[str, Any], arm: str) -> None:
    """Eight runs of one arm on one thread."""
    result = benchmark(kernel.run_batch, **flight, arms=[arm], runs=8, threads=1)
    assert result["nees"].shape == (8, 1, 10)


@pytest.mark.parametrize("method", ["lc", "plcf", "nsv", "info"])
def test_solve_ten_thousand_pings(benchmark: BenchmarkFixture, method: str) -> None:
    """A recorded dive's worth of pings."""
    janus = kernel.BeamGeometry.janus(np.deg2rad(20.0))
    generator = np.random.default_rng(1)
    beams = janus.beam_velocities(generator.normal(size=(10_000, 3)))
    valid = generator.random((10_000, 4)) < 0.8
    fixes = benchmark(kernel.solve_velocity, janus, beams, valid, method=method, beam_sd_mps=0.042)
    assert len(fixes.status) == 10_000
