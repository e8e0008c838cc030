"""The simulated heading sensor: how its readings scatter."""

from typing import Any

import numpy as np

from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import simulate_sensors
from bottomlock.simulation.build import build_simulation
from tests.oracle.rotations import matrix_from_quaternion
from tests.simulation.worlds import kernel_inputs


def true_yaw(truth: Any, time_ns: Any) -> Any:  # noqa: ANN401 - arrays
    """Yaw of truth samples, rad."""
    rows = np.searchsorted(truth.time_ns, time_ns)
    assert (truth.time_ns[rows] == time_ns).all()
    forward = np.array([matrix_from_quaternion(q)[:, 0] for q in truth.attitude_t_p[rows]])
    return np.arctan2(forward[:, 1], forward[:, 0])


def test_readings_scatter_about_the_true_yaw_as_stated() -> None:
    """Over 100 runs of ten readings: squared errors over the variance are chi-squared, false alarm 1e-3."""
    straight = load_scenario("straight").with_trajectory(duration_s=10.0)
    simulated = build_simulation(straight.replace({"heading.enabled": True, "heading.noise_deg": 2.0}))
    key, plan, arrays, model, options = kernel_inputs(simulated)
    total = 0.0
    for run in range(100):
        drawn = simulate_sensors(
            simulated.geometry, arrays, model, plan, seed=9, trajectory_key=key, run=run, options=options,
        )  # fmt: skip
        error = drawn["heading_rad"] - true_yaw(simulated.truth(), drawn["heading_time_ns"])
        total += float(np.sum((error / np.deg2rad(2.0)) ** 2))
    # Chi-squared of 1000 degrees: quantiles of 0.05 % and 99.95 %.
    assert 858.0 < total < 1154.0
