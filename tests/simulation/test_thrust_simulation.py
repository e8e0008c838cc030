"""Simulated speeds by the drives: as a literal equation, streams as stated, scenarios."""

from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import simulate_sensors
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.oracle.rotations import matrix_from_quaternion
from tests.simulation.worlds import current_at, figure_of_eight, kernel_inputs


@pytest.mark.parametrize(("earth", "allowed"), [("tangent_plane", 1e-10), ("ellipsoid", 1e-4)])
def test_they_are_the_literal_equation(earth: str, allowed: float) -> None:
    """Speeds are e_x'(v - R'c(z, t)) / a, with a scale of a fifth more than expected, within 40 m of the origin."""
    simulated = figure_of_eight(earth=earth, thrust={"error_percent": 20.0})
    key, plan, arrays, model, options = kernel_inputs(simulated)
    assert model.thrust is not None
    quiet = model.replace(
        thrust=model.thrust.replace(scale_sd=[0.0] * 3, slip_sd_mps=[0.0] * 3, noise_sd_mps=0.0)
    )
    drawn: Any = simulate_sensors(
        simulated.geometry, arrays, quiet, plan, seed=3, trajectory_key=key, run=1,
        options=options.replace(thrust="off"),
    )  # fmt: skip
    truth = simulated.truth()
    assert len(drawn["thrust_time_ns"]) == 20
    assert np.ptp(truth.position_t_m[:, 2]) > 1.0
    for time_ns, found in zip(drawn["thrust_time_ns"], drawn["thrust_speed_p_mps"], strict=True):
        row = int(np.searchsorted(truth.time_ns, time_ns))
        rotation, depth_m = matrix_from_quaternion(truth.attitude_t_p[row]), truth.position_t_m[row, 2]
        current = np.array(current_at(time_ns * 1e-9, depth_m))
        ahead = truth.velocity_p_mps[row, 0] - (rotation.T @ current)[0]
        assert found.tolist() == pytest.approx([ahead / 1.2, 0.0, 0.0], abs=0.1 * allowed)


def test_scale_slip_and_noise_are_as_stated() -> None:
    """300 runs: the scale of a run, and what slip and noise are about it, within five standard deviations."""
    simulated = figure_of_eight(thrust={"slip_mps": 0.3, "slip_time_s": 0.01, "noise_mps": 0.4})
    key, plan, arrays, model, options = kernel_inputs(simulated)
    assert model.thrust is not None

    def speeds_mps(run: int, one: Any) -> Any:  # noqa: ANN401 - a model
        return simulate_sensors(
            simulated.geometry, arrays, one, plan, seed=9, trajectory_key=key, run=run, options=options
        )["thrust_speed_p_mps"][:, 0]

    quiet = model.replace(thrust=model.thrust.replace(slip_sd_mps=[1e-300, 0.0, 0.0], noise_sd_mps=0.0))
    certain = quiet.replace(thrust=quiet.of(type(model.thrust)).replace(scale_sd=[0.0] * 3))
    expected = speeds_mps(0, certain)
    scale, about = [], []
    for run in range(300):
        exact = speeds_mps(run, quiet)
        scale.append(float(expected[0] / exact[0]))
        about.append((speeds_mps(run, model) - exact) * scale[-1] / 0.5)
    assert abs(np.mean(scale) - 1.0) < 5.0 * 0.1 / np.sqrt(300)
    assert abs(np.std(scale) / 0.1 - 1.0) < 5.0 / np.sqrt(600)
    assert abs(np.mean(np.square(about)) - 1.0) < 5.0 * np.sqrt(2.0 / np.size(about))


def test_water_moves_under_a_truth_without_a_vehicle() -> None:
    """The current stands in [water_track], also where that is off, and then decides the numbers.

    The motion over ground stays, and ahead along the current the water passes the more slowly.
    """
    content = (
        load_scenario("straight")
        .with_trajectory(duration_s=3.0, source="analytic")
        .model_dump(exclude_unset=True)
    )

    def of(speed_mps: float, *, enabled: bool = False) -> Scenario:
        water = {"enabled": enabled, "current": {"speed_mps": speed_mps}}
        return Scenario.model_validate(content | {"thrust": {"error_percent": 0.0}, "water_track": water})

    still, moving = (
        sensor_streams(build_simulation(of(speed)), build_simulation(of(speed)).truth())
        for speed in (0.0, 0.3)
    )
    gap = still["thrust"]["speed_surge_mps"] - moving["thrust"]["speed_surge_mps"]
    said_mps = float(still["thrust"]["speed_surge_mps"].mean())  # type: ignore[arg-type]
    np.testing.assert_allclose(gap * 2.0 / said_mps, 0.3, rtol=0.05)
    assert of(0.0).content_hash() != of(0.3).content_hash()
    worlds = [build_simulation(of(speed, enabled=True)) for speed in (0.0, 0.3)]
    calm, current = (world.truth().velocity_p_mps for world in worlds)
    np.testing.assert_array_equal(calm, current)
    beams = [sensor_streams(world, world.truth())["beams_water"]["beam1_mps"].to_numpy() for world in worlds]
    np.testing.assert_allclose(beams[0] - beams[1], 0.3 * worlds[0].geometry.directions_p[0][0], rtol=0.05)
