"""The simulated heading sensor: its random stream, scatter, a campaign's run, scenario keys, observability."""

from __future__ import annotations

from typing import Any

import numpy as np

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import run_batch, simulate_sensors
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.oracle.rotations import matrix_from_quaternion
from tests.run_events import Readings
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


def test_switching_it_on_shifts_no_other_stream() -> None:
    with_it, without = simulation(), simulation(heading=False)
    truth = without.truth()
    on, off = (sensor_streams(one, truth, run=3) for one in (with_it, without))
    assert (on["heading"].height, off["heading"].height) == (12, 0)
    for name in ("imu", "beams", "depth", "attitude", "gps"):
        assert off[name].height > 0
        assert off[name].equals(on[name]), name


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


def test_a_campaigns_run_is_the_streaming_navigator() -> None:
    """Mean NIS of the DVL equals the batch's, with headings pushed in between."""
    simulated = simulation()
    key, plan, arrays, model, options = kernel_inputs(simulated)
    batch = run_batch(
        simulated.geometry, arrays, model, model, options, plan, ["tc"], seed=simulated.scenario.campaign.seed,
        trajectory_key=key, first_run=2, runs=1, threads=1,
    )  # fmt: skip
    readings = Readings(simulated, simulated.truth(), run=2)
    fixes = list(readings.fixes("tc", readings.valid, range(len(readings.valid))))
    assert np.mean([fix.nis for fix in fixes]) == batch["nis_mean"][0, 0]
