"""Simulated acoustic fixes: their own random stream and scatter, schedules, scenarios."""

from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import simulate_sensors
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.oracle import acoustic_position as oracle
from tests.oracle.rotations import matrix_from_quaternion
from tests.run_events import Readings
from tests.simulation.worlds import ACOUSTIC, ALWAYS, kernel_inputs


def scenario(seconds: float = 20.0, **keys: Any) -> Scenario:  # noqa: ANN401 - any key of the section
    """The straight way with every sensor on."""
    content = load_scenario("straight").with_trajectory(duration_s=seconds).model_dump(exclude_unset=True)
    return Scenario.model_validate(content | ALWAYS | {"acoustic_position": ACOUSTIC | keys})


def simulation(seconds: float = 20.0, **keys: Any) -> Simulation:  # noqa: ANN401
    return build_simulation(scenario(seconds, **keys))


def oracle_arm(truth: Any, time_ns: Any) -> Any:  # noqa: ANN401 - arrays
    """Where the transponder truly is at times that are truth samples."""
    rows = np.searchsorted(truth.time_ns, time_ns)
    assert (truth.time_ns[rows] == time_ns).all()
    pairs = zip(truth.position_t_m[rows], truth.attitude_t_p[rows], strict=True)
    arm = np.array(ACOUSTIC["lever_arm_m"])
    return np.array([oracle.expected_fix(place, matrix_from_quaternion(q), arm) for place, q in pairs])


def test_readings_are_the_campaigns_and_have_their_deviation() -> None:
    """The table holds the readings of a campaign's run; the stated deviation is that of the fix's own slant range."""
    simulated = simulation()
    truth, scenario = simulated.truth(), simulated.scenario
    table = sensor_streams(simulated, truth, run=1)["acoustic_position"]
    drawn = Readings(simulated, truth, run=1)._drawn
    fixes = table.select("position_north_m", "position_east_m", "position_down_m").to_numpy()
    assert np.array_equal(fixes, drawn["acoustic_position_t_m"])
    section = scenario.acoustic_position
    for row, fix in zip(table.iter_rows(named=True), fixes, strict=True):
        sd = oracle.deviation(
            fix, np.array(section.transceiver_m), section.noise_m, section.noise_percent_of_range / 100
        )
        assert [row["sd_north_m"], row["sd_east_m"], row["sd_down_m"]] == pytest.approx([sd] * 3)


def test_a_section_that_is_not_there_decides_nothing() -> None:
    """It is off by default, and the hash of a scenario without it is that of one that does not have the sensor."""
    plain = load_scenario("straight")
    assert not plain.acoustic_position.enabled
    named = plain.model_copy(update={"acoustic_position": plain.acoustic_position.model_copy()})
    assert named.content_hash() == plain.content_hash()
    assert plain.replace({"acoustic_position.rate_hz": 0.5}).content_hash() != plain.content_hash()
    assert "acoustic_position" not in plain.model_fields_set


def test_simulated_fixes_scatter_as_stated() -> None:
    """Over 400 runs of one fix: squared errors over the stated variances are chi-squared, false alarm 1e-3."""
    simulated = simulation(1.0)
    truth = simulated.truth()
    key, plan, arrays, kernel_model, kernel_options = kernel_inputs(simulated)
    total = 0.0
    for run in range(400):
        drawn = simulate_sensors(
            simulated.geometry, arrays, kernel_model, plan, seed=9, trajectory_key=key, run=run,
            options=kernel_options,
        )  # fmt: skip
        error = drawn["acoustic_position_t_m"] - oracle_arm(truth, drawn["acoustic_position_time_ns"])
        total += float(np.sum((error / drawn["acoustic_position_sd_m"]) ** 2))
    # Chi-squared of 1200 degrees: quantiles of 0.05 % and 99.95 %; the sd of a fix's own range adds below 1 %.
    assert 1044.0 < total < 1369.0
