"""Water track where no beam reaches the bottom: NEES of velocity, position and current, and what it is worth.

A straight run with the sensors' errors of the scenario and a current that is drawn from the filter's prior and stays.
For a minute every other ping returns from the bottom, the others from the water; then all from the water. Three bands
of 2.5e-4 each. The seed was not chosen.
"""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.config.scenario import load_scenario
from bottomlock.kernel import Navigator
from bottomlock.kernel.models import CurrentLayers
from bottomlock.simulation.build import build_simulation
from bottomlock.statistics.chi_squared import mean_band
from tests.imu_blocks import measured
from tests.run_events import Readings

RUNS, SECONDS, LOCK_S = 40, 240.0, 60.0
WITHOUT = 10
"""Runs without water track, whose error is twenty times as large: what is asserted of it is a factor of ten."""
PROBABILITY = 1.0 - 2.5e-4


def run_filter(runs: int, *, water_track: bool) -> dict[str, np.ndarray[Any, Any]]:
    """NEES of each run of `tc` at the end by quantity, and its horizontal error, m."""
    scenario = load_scenario("straight").with_trajectory(duration_s=SECONDS, source="analytic")
    simulation = build_simulation(scenario)
    truth = simulation.truth()
    # A current that stays has no correlation time.
    options = scenario.kernel_options()
    options = options.replace(
        water_track=water_track,
        water=options.water.replace(current_time_s=1e9),
        current_layers=CurrentLayers(sd_mps=0.0),
        gate="off",
    )
    attitude = Rotation.from_quat(truth.attitude_t_p, scalar_first=True)
    found: dict[str, list[float]] = {"velocity": [], "position": [], "current": [], "error_m": []}
    for run in range(runs):
        readings = Readings(simulation, truth, run=run)
        drawn: Any = readings._drawn
        current = np.append(np.random.default_rng(run).normal(0.0, options.water.current_sd_mps, 2), 0.0)
        navigator = Navigator(simulation.geometry, readings._model, options, drawn["initial"], method="tc")
        beams = simulation.geometry.beams
        sd, every = np.full(beams, scenario.dvl.beam_noise_mps), np.ones(beams, dtype=bool)
        for k, time_ns in measured(navigator, drawn, drawn["dvl_time_ns"]):
            beam_mps = drawn["dvl_velocity_mps"][k]
            if time_ns < LOCK_S * 1e9 and k % 2 == 0:
                navigator.push_beams(time_ns, beam_mps, every, sd_mps=sd)
            elif water_track:
                at = int(np.searchsorted(truth.time_ns, time_ns))
                along = simulation.geometry.beam_velocities([attitude[at].inv().apply(current)])[0]
                navigator.push_water_track(time_ns, beam_mps - along, every, sd_mps=sd)
        state, cov = navigator.state(), navigator.covariance()
        row = int(np.searchsorted(truth.time_ns, state["time_ns"]))
        moved = np.asarray(state["position_t_m"]) - truth.position_t_m[row]
        faster = np.asarray(state["velocity_p_mps"]) - truth.velocity_p_mps[row]
        found["error_m"].append(float(np.hypot(moved[0], moved[1])))
        found["position"].append(float(moved[:2] @ np.linalg.solve(cov[:2, :2], moved[:2])))
        found["velocity"].append(float(faster @ np.linalg.solve(cov[6:9, 6:9], faster)))
        water = navigator.water()
        if water is not None:
            off = np.asarray(water["current_t_mps"])[:2] - current[:2]
            own = np.asarray(water["current_covariance"])[:2, :2]
            found["current"].append(float(off @ np.linalg.solve(own, off)))
    return {name: np.array(values) for name, values in found.items()}


def test_is_consistent_and_bounds_the_error() -> None:
    """Seen: NEES of velocity 2.7 of 3, position 2.3 of 2, current 1.9 of 2; 12 m, and 237 m without."""
    found = run_filter(RUNS, water_track=True)
    for name, degrees in {"velocity": 3, "position": 2, "current": 2}.items():
        low, high = mean_band(degrees, RUNS, PROBABILITY)
        assert low < found[name].mean() < high, (name, found[name].mean())
    without = run_filter(WITHOUT, water_track=False)
    assert np.median(found["error_m"]) < 0.1 * np.median(without["error_m"])
