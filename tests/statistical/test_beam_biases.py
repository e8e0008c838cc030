"""Biases of six and of eight beams: a filter that estimates them all is consistent."""

from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.kernel import BeamGeometry, Method
from bottomlock.statistics.chi_squared import mean_band
from tests.analytic import analytic_simulation
from tests.statistical import ensembles

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

RUNS = 60
METHODS: tuple[Method, ...] = ("tc", "lc")


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("beams", [6, 8])
def test_biases_of_all_beams_are_estimated(beams: int) -> None:
    """Six times as large as the noise; NEES at every sample time, with a false-alarm rate of 1 %."""
    simulation = analytic_simulation("figure_eight", imu_hz=50.0)
    scenario, truth = simulation.scenario, simulation.truth()
    azimuths = np.arange(beams) * 2.0 * np.pi / beams
    geometry = BeamGeometry.from_angles(np.deg2rad(20.0 + 10.0 * (np.arange(beams) % 2)), azimuths)
    schedule: Any = bottomlock.measurement_schedule(simulation, truth)
    schedule["beam_valid"] = np.ones((len(schedule["dvl_time_ns"]), beams), dtype=bool)
    schedule["sample_time_ns"] = schedule["sample_time_ns"][49::50]
    model = scenario.kernel_model(simulation.gravity_mps2)
    assert model.dvl is not None
    dvl = model.dvl.replace(beam_noise_sd_mps=0.005, beam_bias_sd_mps=0.03, beam_bias_walk_mps_rts=5e-4)
    arrays: Any = truth.kernel_arrays()
    model = model.replace(dvl=dvl)
    batch = bottomlock.run_batch(
        geometry, arrays, model, model, scenario.kernel_options().replace(gate="off"), schedule, METHODS,
        seed=ensembles.SEED, trajectory_key=71, first_run=0, runs=RUNS, threads=1,
    )  # fmt: skip
    each = 1.0 - 0.01 / (2 * batch["nees"].shape[2] * len(METHODS))
    for means, degrees in ((batch["nees_velocity_attitude"], 6.0), (batch["nees"], 20.0)):
        low, high = mean_band(degrees, RUNS, each)
        assert (means.mean(axis=0) < high).all(), means.mean(axis=0)
        assert (means.mean(axis=0) > low).all(), means.mean(axis=0)
