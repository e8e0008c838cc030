"""What Python sees: timed by `make bench`, run once as a test elsewhere; compare by ratio within one run."""

from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from bottomlock import kernel
from bottomlock.conditions import schedule
from bottomlock.plant import swim
from bottomlock.scenario import load_scenario
from bottomlock.world import make_world
from tests.analytic import analytic_world


@pytest.fixture(scope="module")
def flight() -> dict[str, Any]:
    """Ten seconds of the straight trajectory."""
    world = analytic_world("straight", duration_s=10.0)
    scenario, truth = world.scenario, world.truth()
    model = scenario.kernel_model(world.gravity_mps2)
    return {
        "geometry": world.geometry, "truth": truth.kernel_arrays(), "simulated": model, "assumed": model,
        "options": scenario.kernel_options(), "schedule": schedule(world, truth), "seed": 1, "trajectory_key": 2,
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


@pytest.mark.parametrize("name", ["straight", "figure_eight", "lawn_mower"])
def test_swim(benchmark: BenchmarkFixture, name: str) -> None:
    """A truth from nothing: 250 s of the vehicle at the IMU's rate."""
    world = make_world(load_scenario(name))
    vehicle, mission = world.vehicle, world.mission
    assert vehicle is not None
    assert mission is not None
    passage = benchmark(swim, vehicle, mission, gravity_mps2=world.gravity_mps2)
    assert len(passage.time_ns) == 37_501
