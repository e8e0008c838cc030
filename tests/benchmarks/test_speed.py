"""What Python sees: timed by `make bench`, run once as a test elsewhere; compare by ratio within one run."""

from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from bottomlock import kernel
from bottomlock.campaign.run import run_campaign
from bottomlock.config.scenario import load_scenario
from bottomlock.kernel.models import InitialState
from bottomlock.plant import swim
from bottomlock.simulation.build import build_simulation
from tests.analytic import batch_along


@pytest.fixture(scope="module")
def flight() -> dict[str, Any]:
    """Ten seconds of the straight trajectory."""
    return batch_along(10.0)


@pytest.mark.parametrize("runs", [0, 8])
def test_batch_of_runs(benchmark: BenchmarkFixture, flight: dict[str, Any], runs: int) -> None:
    """Eight methods on one thread; no run at all is what a call costs by itself."""
    methods = ["ins", "lc", "tc", "vb", "nsv", "plcf", "vhv", "elc"]
    result = benchmark(kernel.run_batch, **flight, methods=methods, runs=runs, threads=1)
    assert result["nees"].shape == (runs, 8, 10)


def test_push_one_inertial_reading(benchmark: BenchmarkFixture, flight: dict[str, Any]) -> None:
    """A navigator fed from Python, event by event."""
    truth = flight["truth"]
    state = {key: truth[key][0] for key in ("position_t_m", "attitude_t_p", "velocity_p_mps")}
    start = InitialState(time_ns=0, **state)
    navigator = kernel.Navigator(flight["geometry"], flight["assumed"], flight["options"], start, method="tc")
    rate, force, times = np.array([0.0, 0.0, 0.01]), np.array([0.0, 0.0, -9.79]), count(0, 6_666_667)
    reports = benchmark(lambda: navigator.push_imu(next(times), omega_p_radps=rate, force_p_mps2=force))
    assert reports == []


def test_small_campaign(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """Ten seconds, four runs, three methods: truth, noise, filters, Parquet, statistics."""
    scenario = load_scenario("straight").with_overrides(runs=4, methods=["ins", "lc", "tc"])
    short, number = scenario.with_trajectory(duration_s=10.0), count()
    results = benchmark(lambda: run_campaign([short], tmp_path / str(next(number)), threads=1))
    assert results.runs.height == 12


def test_solve_ten_thousand_pings(benchmark: BenchmarkFixture) -> None:
    """A recorded dive's worth of pings."""
    janus = kernel.BeamGeometry.janus(np.deg2rad(20.0))
    generator = np.random.default_rng(1)
    beams = janus.beam_velocities(generator.normal(size=(10_000, 3)))
    valid = generator.random((10_000, 4)) < 0.8
    fixes = benchmark(kernel.solve_velocity, janus, beams, valid, method="lc", beam_sd_mps=0.042)
    assert len(fixes.status) == 10_000


def test_swim(benchmark: BenchmarkFixture) -> None:
    """A truth from nothing: 50 s of the vehicle at the IMU's rate."""
    simulation = build_simulation(load_scenario("straight").with_trajectory(duration_s=50.0))
    vehicle, mission = simulation.vehicle, simulation.mission
    assert vehicle is not None
    assert mission is not None
    history = benchmark(swim, vehicle, mission, gravity_mps2=simulation.gravity_mps2)
    assert len(history.time_ns) == 7_501
