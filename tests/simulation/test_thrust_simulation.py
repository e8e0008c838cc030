"""Simulated revolutions: as a literal equation, streams of their own, campaign, closed loop, scenarios."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import run_batch, simulate_sensors
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.oracle.rotations import matrix_from_quaternion
from tests.run_events import Readings
from tests.simulation.test_acoustic_simulation import kernel_inputs

CURRENT = {
    "speed_mps": 0.4,
    "towards_deg": 60.0,
    "turn_deg_per_h": 900.0,
    "shear_north_mps_per_m": 0.01,
    "shear_east_mps_per_m": -0.02,
}


def simulation(seconds: float = 20.0, *, thrust: bool = True, **keys: Any) -> Simulation:  # noqa: ANN401 - any key
    """A figure of eight that dives in a current that turns and is sheared, with other sensors on."""
    content = load_scenario("figure_eight").with_trajectory(duration_s=seconds).model_dump(exclude_unset=True)
    content["mission"] = {**content.get("mission", {}), "current": CURRENT}
    content["environment"] = {**content.get("environment", {}), "earth": keys.pop("earth", "tangent_plane")}
    content |= {"depth": {}, "magnetometer": {}, "gps": {"antenna_depth_m": 1e3}}
    return build_simulation(Scenario.model_validate(content | ({"thrust": keys} if thrust else {})))


@pytest.mark.parametrize(("earth", "allowed"), [("tangent_plane", 1e-10), ("ellipsoid", 1e-4)])
def test_they_are_the_literal_equation(earth: str, allowed: float) -> None:
    """Revolutions are e_x'(v - R'c(z, t)) / a, with a fifth more advance than expected, within 40 m of the origin."""
    simulated = simulation(earth=earth, error_percent=20.0)
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
        towards = np.deg2rad(60.0 + 0.25 * time_ns * 1e-9)
        current = np.array(
            [0.4 * np.cos(towards) + 0.01 * depth_m, 0.4 * np.sin(towards) - 0.02 * depth_m, 0.0]
        )
        ahead = truth.velocity_p_mps[row, 0] - (rotation.T @ current)[0]
        assert found == pytest.approx(ahead / 0.12, abs=allowed)


def test_switching_it_on_shifts_no_other_stream() -> None:
    off, on = simulation(thrust=False), simulation()
    truth = off.truth()
    without, with_it = (sensor_streams(one, truth, run=3) for one in (off, on))
    assert without["thrust"].height == 0
    assert with_it["thrust"].columns == ["time_ns", "revolutions_hz"]
    assert with_it["thrust"].height == 20
    for name in ("imu", "beams", "depth", "attitude", "gps"):
        assert without[name].height > 0
        assert without[name].equals(with_it[name]), name


def test_advance_slip_and_noise_are_as_stated() -> None:
    """300 runs: the advance of a run, and what slip and noise are about it, within five standard deviations."""
    simulated = simulation(slip_mps=0.3, slip_time_s=0.01, noise_mps=0.4)
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


@pytest.mark.parametrize("method", ["tc", "sway_current"])
def test_a_campaigns_run_is_the_streaming_navigator(method: str) -> None:
    simulated = simulation(corrects="all")
    key, plan, arrays, model, options = kernel_inputs(simulated)
    common: Any = {
        "seed": simulated.scenario.campaign.seed, "trajectory_key": key, "first_run": 2, "runs": 1, "threads": 1,
    }  # fmt: skip
    batch = run_batch(simulated.geometry, arrays, model, model, options, plan, [method], **common)
    readings = Readings(simulated, simulated.truth(), run=2)
    fixes = list(readings.fixes(method, readings.valid, range(len(readings.valid))))
    assert sum(fix.nis for fix in fixes) / len(fixes) == batch["nis_mean"][0, 0]
    dry: Any = {name: values for name, values in plan.items() if not name.startswith("thrust_")}
    without = run_batch(simulated.geometry, arrays, model, model, options, dry, [method], **common)
    assert without["nis_mean"][0, 0] != batch["nis_mean"][0, 0]


def test_water_moves_under_a_truth_without_a_vehicle() -> None:
    """The current stands in [water_track], also where that is off, and then decides the numbers."""
    content = (
        load_scenario("straight")
        .with_trajectory(duration_s=3.0, source="analytic")
        .model_dump(exclude_unset=True)
    )

    def of(speed_mps: float) -> Scenario:
        water = {"enabled": False, "current": {"speed_mps": speed_mps}}
        return Scenario.model_validate(content | {"thrust": {"error_percent": 0.0}, "water_track": water})

    still, moving = (
        sensor_streams(build_simulation(of(speed)), build_simulation(of(speed)).truth())
        for speed in (0.0, 0.3)
    )
    gap = still["thrust"]["revolutions_hz"] - moving["thrust"]["revolutions_hz"]
    per_m = float(still["thrust"]["revolutions_hz"].mean()) / 2.0  # type: ignore[arg-type]
    np.testing.assert_allclose(gap / per_m, 0.3, rtol=0.05)
    assert of(0.0).content_hash() != of(0.3).content_hash()
