"""Simulated revolutions: as a literal equation, streams as stated, scenarios."""

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
    """Revolutions are e_x'(v - R'c(z, t)) / a, with a fifth more advance than expected, within 40 m of the origin."""
    simulated = figure_of_eight(earth=earth, thrust={"error_percent": 20.0})
    key, plan, arrays, model, options = kernel_inputs(simulated)
    assert model.thrust is not None
    quiet = model.replace(thrust=model.thrust.replace(advance_sd_m=0.0, slip_sd_mps=0.0, noise_sd_mps=0.0))
    drawn: Any = simulate_sensors(
        simulated.geometry, arrays, quiet, plan, seed=3, trajectory_key=key, run=1,
        options=options.replace(thrust="off"),
    )  # fmt: skip
    truth = simulated.truth()
    assert len(drawn["thrust_time_ns"]) == 20
    assert np.ptp(truth.position_t_m[:, 2]) > 1.0
    for time_ns, found in zip(drawn["thrust_time_ns"], drawn["thrust_revolutions_hz"], strict=True):
        row = int(np.searchsorted(truth.time_ns, time_ns))
        rotation, depth_m = matrix_from_quaternion(truth.attitude_t_p[row]), truth.position_t_m[row, 2]
        current = np.array(current_at(time_ns * 1e-9, depth_m))
        ahead = truth.velocity_p_mps[row, 0] - (rotation.T @ current)[0]
        assert found == pytest.approx(ahead / 0.12, abs=allowed)


def test_advance_slip_and_noise_are_as_stated() -> None:
    """300 runs: the advance of a run, and what slip and noise are about it, within five standard deviations."""
    simulated = figure_of_eight(thrust={"slip_mps": 0.3, "slip_time_s": 0.01, "noise_mps": 0.4})
    key, plan, arrays, model, options = kernel_inputs(simulated)
    assert model.thrust is not None

    def turns(run: int, one: Any) -> Any:  # noqa: ANN401 - a model
        return simulate_sensors(
            simulated.geometry, arrays, one, plan, seed=9, trajectory_key=key, run=run, options=options
        )["thrust_revolutions_hz"]

    quiet = model.replace(thrust=model.thrust.replace(slip_sd_mps=1e-300, noise_sd_mps=0.0))
    certain = quiet.replace(thrust=quiet.of(type(model.thrust)).replace(advance_sd_m=0.0))
    expected = 0.1 * turns(0, certain)
    advance, about = [], []
    for run in range(300):
        exact = turns(run, quiet)
        advance.append(float(expected[0] / exact[0]))
        about.append((turns(run, model) - exact) * advance[-1] / 0.5)
    assert abs(np.mean(advance) - 0.1) < 5.0 * 0.01 / np.sqrt(300)
    assert abs(np.std(advance) / 0.01 - 1.0) < 5.0 / np.sqrt(600)
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
    gap = still["thrust"]["revolutions_hz"] - moving["thrust"]["revolutions_hz"]
    per_m = float(still["thrust"]["revolutions_hz"].mean()) / 2.0  # type: ignore[arg-type]
    np.testing.assert_allclose(gap / per_m, 0.3, rtol=0.05)
    assert of(0.0).content_hash() != of(0.3).content_hash()
    worlds = [build_simulation(of(speed, enabled=True)) for speed in (0.0, 0.3)]
    calm, current = (world.truth().velocity_p_mps for world in worlds)
    np.testing.assert_array_equal(calm, current)
    beams = [sensor_streams(world, world.truth())["beams_water"]["beam1_mps"].to_numpy() for world in worlds]
    np.testing.assert_allclose(beams[0] - beams[1], 0.3 * worlds[0].geometry.directions_p[0][0], rtol=0.05)
