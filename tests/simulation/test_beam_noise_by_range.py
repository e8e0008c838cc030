"""Noise of beams that grows with their range: in the simulator."""

from typing import Any

import numpy as np
import pytest

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.errors import KernelError, ScenarioError
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule

GROWTH = 1e-3


def test_the_error_of_a_reading_grows_with_its_range() -> None:
    """The draws stay: an error at r is that at 0 times √(σ² + (k r)²) / σ, and k = 0 has the bits of before."""
    scenario = load_scenario("slope").with_trajectory(source="analytic", duration_s=40.0)
    scenario = scenario.replace({"dvl.beam_noise_mps_per_m": GROWTH, "dvl.dropouts": []})
    simulation = build_simulation(scenario)
    truth = simulation.truth()
    schedule: Any = measurement_schedule(simulation, truth)
    ranges = schedule["beam_range_m"]
    assert ranges.shape == schedule["beam_valid"].shape
    assert np.ptp(ranges) > 15.0
    model = scenario.kernel_model(simulation.gravity_mps2)
    assert model.dvl is not None
    beams = {}
    for name, sd, growth in (("none", 0.0, 0.0), ("constant", 0.042, 0.0), ("both", 0.042, GROWTH)):
        dvl = model.dvl.replace(beam_noise_sd_mps=sd, beam_noise_sd_mps_per_m=growth)
        arrays: Any = truth.kernel_arrays()
        drawn = kernel.simulate_sensors(
            simulation.geometry, arrays, model.replace(dvl=dvl), schedule, seed=1, trajectory_key=2, run=3
        )
        beams[name] = drawn["dvl_velocity_mps"]
    constant, both = beams["constant"] - beams["none"], beams["both"] - beams["none"]
    np.testing.assert_allclose(both, constant * np.hypot(0.042, GROWTH * ranges) / 0.042, atol=1e-12)
    del schedule["beam_range_m"]
    with pytest.raises(KernelError, match=r"schedule\.beam_range_m is missing"):
        kernel.simulate_sensors(simulation.geometry, arrays, model, schedule, seed=1, trajectory_key=2, run=3)


def test_it_needs_a_seabed() -> None:
    with pytest.raises(ScenarioError, match="beam_noise_mps_per_m is given, but there is no"):
        load_scenario("straight").replace({"dvl.beam_noise_mps_per_m": GROWTH})
