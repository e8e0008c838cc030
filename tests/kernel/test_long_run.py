"""Half an hour with sensors of every kind and outages of the DVL: what every method holds of it stays sound."""

from typing import Any

import numpy as np
import pytest

from bottomlock import kernel
from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import Method
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule
from tests.drawn_log import drawn_log

METHODS: tuple[Method, ...] = ("tc", "sway_current", "weak_sway", "elc")
BOUNDS = {"position_t_m": 100.0, "velocity_p_mps": 2.0}
"""A filter that diverges leaves them within minutes."""


@pytest.mark.long
def test_covariances_and_errors_stay_sound() -> None:
    """Once a minute: correlations symmetric and of a Cholesky factor, quaternions of norm 1, errors within bounds."""
    simulation = build_simulation(load_scenario("survey_table2").with_trajectory(duration_s=1800.0))
    scenario, truth = simulation.scenario, simulation.truth()
    plan: Any = dict(measurement_schedule(simulation, truth))
    # A beam returns four times of five, and none for 20 s of every ten minutes.
    times_s = plan["dvl_time_ns"] * 1e-9
    valid = np.random.default_rng(16).random((len(times_s), 4)) < 0.8
    plan["beam_valid"] = valid & (times_s % 600.0 >= 20.0)[:, None]
    model, arrays = scenario.kernel_model(simulation.gravity_mps2), truth.kernel_arrays()
    drawn = kernel.simulate_sensors(
        simulation.geometry, arrays, model, plan, seed=1, trajectory_key=1, run=0,  # type: ignore[arg-type]
        imu_sampling=scenario.imu.sampling, options=scenario.kernel_options(),
    )  # fmt: skip
    log = drawn_log(drawn, "gps", "acoustic_position")
    samples = truth.time_ns[:: round(60 * scenario.imu.rate_hz)][1:]
    out: Any = kernel.replay_log(
        simulation.geometry, model, scenario.kernel_options(), METHODS, log, drawn["initial"],
        sample_time_ns=samples, covariances=True,
    )  # fmt: skip
    scale = 1.0 / np.sqrt(np.diagonal(out["covariance"], axis1=-2, axis2=-1))
    correlation = out["covariance"] * scale[..., :, None] * scale[..., None, :]
    assert np.abs(correlation - np.swapaxes(correlation, -1, -2)).max() < 1e-12
    np.linalg.cholesky(correlation)
    assert np.abs(np.linalg.norm(out["attitude_t_p"], axis=-1) - 1.0).max() < 1e-12
    at = np.searchsorted(truth.time_ns, samples)
    for name, most in BOUNDS.items():
        assert np.linalg.norm(out[name] - getattr(truth, name)[at], axis=-1).max() < most, name
