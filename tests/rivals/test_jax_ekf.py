"""The batched filter in JAX against the kernel. JAX is installed by `make test-others` alone."""

from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import make_geometry

pytest.importorskip("jax", reason="JAX is installed for the rivals alone")
jax_ekf: Any = import_module("benches.rivals.jax_ekf")
missions: Any = import_module("benches.rivals.scenario_missions")

SECONDS = 12.0


def batch_of_runs(runs: int) -> list[Any]:
    """Turning and climbing, beams 1 and 2 and a heading, and a DVL apart from the IMU with another speed of sound."""
    scenario = load_scenario("figure_eight").with_trajectory(duration_s=SECONDS)
    scenario = scenario.replace({"filter.gate_probability": 0.9, "heading.enabled": True})
    geometry = make_geometry(
        "x", tilt_rad=0.35, lever_arms_p_m=[[2.0, -1.0, 0.5]] * 4, sound_speed_scale=1.01
    )
    return [replace(missions.scenario_mission(scenario, run), geometry=geometry) for run in range(runs)]


@pytest.mark.long
def test_equal_to_the_kernel() -> None:
    """State, covariance and gate of tight coupling, at every second of three runs beside each other."""
    batch = batch_of_runs(3)
    states = jax_ekf.run(jax_ekf.batch_of(batch))
    for run, mission in enumerate(batch):
        expected = missions.tightly_coupled(mission, covariance_period_ns=0)
        for name, found, whole in (
            ("velocity", states.velocity[run], expected.velocity_p_mps),
            ("position", states.position[run], expected.position_t_m),
            ("attitude", states.attitude[run], expected.attitude_t_p),
            ("velocity covariance", states.covariance[run, :, 6:9, 6:9], expected.velocity_cov),
            ("position covariance", states.covariance[run, :, :3, :3], expected.position_cov),
        ):
            scale = np.abs(whole).max()
            assert np.abs(np.asarray(found) - whole).max() < 1e-6 * scale, name


def test_segments_hold_every_reading_once() -> None:
    """Epochs between inertial samples cut a mean in two; nothing is lost or counted twice."""
    mission = batch_of_runs(1)[0]
    epochs = np.sort(np.r_[mission.grid_ns, mission.grid_ns - 123_456_789])
    segments = jax_ekf._segments(mission, epochs)
    elapsed = np.asarray(segments.dt).sum(axis=1)
    np.testing.assert_allclose(elapsed, np.diff(epochs, prepend=0) * 1e-9, atol=1e-12)
    impulse = np.einsum("el,elk->k", segments.dt, segments.force)
    rows = mission.imu.time_ns <= epochs[-1]
    weight = np.diff(mission.imu.time_ns, prepend=mission.imu.time_ns[0]) * 1e-9
    np.testing.assert_allclose(impulse, weight[rows] @ mission.imu.force_p_mps2[rows], rtol=1e-12)


def test_missions_of_other_times_are_refused() -> None:
    first, other = (
        batch_of_runs(1)[0],
        missions.scenario_mission(load_scenario("straight").with_trajectory(duration_s=SECONDS - 2.0)),
    )
    with pytest.raises(ValueError, match="times of imu differ"):
        jax_ekf.batch_of([first, other])
