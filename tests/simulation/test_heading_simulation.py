"""The simulated heading sensor: its random stream, scatter, a campaign's run, scenario keys, observability."""

from __future__ import annotations

from typing import Any

import numpy as np

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import run_batch, simulate_sensors
from bottomlock.observability.report import scenario_schedule
from bottomlock.simulation.build import Simulation, build_simulation
from tests.oracle.rotations import matrix_from_quaternion
from tests.simulation.test_acoustic_simulation import kernel_inputs


def simulation(seconds: float = 12.0, *, heading: bool = True, **keys: Any) -> Simulation:  # noqa: ANN401 - any key
    """The straight way with every sensor on."""
    content = load_scenario("straight").with_trajectory(duration_s=seconds).model_dump(exclude_unset=True)
    on: dict[str, dict[str, Any]] = {"depth": {}, "magnetometer": {}, "gps": {"antenna_depth_m": 1e3}}
    on |= {"heading": keys} if heading else {}
    return build_simulation(Scenario.model_validate(content | on))


def true_yaw(truth: Any, time_ns: Any) -> Any:  # noqa: ANN401 - arrays
    """Yaw of truth samples, rad."""
    rows = np.searchsorted(truth.time_ns, time_ns)
    assert (truth.time_ns[rows] == time_ns).all()
    forward = np.array([matrix_from_quaternion(q)[:, 0] for q in truth.attitude_t_p[rows]])
    return np.arctan2(forward[:, 1], forward[:, 0])


def test_readings_scatter_about_the_true_yaw_as_stated() -> None:
    """Over 100 runs of ten readings: squared errors over the variance are chi-squared, false alarm 1e-3."""
    simulated = simulation(10.0, noise_deg=2.0)
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


def test_a_heading_bounds_the_yaw() -> None:
    """On a straight way nothing else sees the yaw: with headings of 0.2 deg its error stays within them."""
    ends = []
    for heading in (True, False):
        simulated = simulation(60.0, heading=heading, **({"noise_deg": 0.2} if heading else {}))
        quiet = {name: getattr(simulated.scenario, name).model_copy(update={"enabled": False})
                 for name in ("magnetometer", "gps")}  # fmt: skip
        simulated = build_simulation(simulated.scenario.model_copy(update=quiet))
        _, plan, arrays, model, options = kernel_inputs(simulated)
        batch = run_batch(
            simulated.geometry, arrays, model, model, options, plan, ["tc"], seed=5,
            trajectory_key=1, first_run=0, runs=20, threads=1,
        )  # fmt: skip
        ends.append(np.sqrt(np.mean(batch["error"][:, 0, -1, 5] ** 2)))
    assert np.rad2deg(ends[0]) < 0.1
    assert ends[1] > 5.0 * ends[0]


def test_schedule_of_a_scenario_has_it() -> None:
    simulated = simulation(5.0, rate_hz=2.0)
    schedule, _ = scenario_schedule(simulated, simulated.truth())
    assert int(schedule.others["heading"].sum()) == 10
