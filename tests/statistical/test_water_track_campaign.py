"""Ten minutes of water track after one minute of bottom and water, in campaigns: what it is worth, and consistency.

A vehicle that turns twice and dives between 20 and 50 m, in a current that every run shares. A single sample of a seed
that was not chosen; a band holds with probability 1 - 1e-3. An ensemble of currents is that of `test_water_track.py`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.kernel import Method, run_batch
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.statistics.chi_squared import mean_band

pytestmark = [pytest.mark.statistical, pytest.mark.long]
RUNS, DURATION_S, LOCK_S = 40, 660.0, 60.0
PROBABILITY = 1.0 - 1e-3
METHODS: tuple[Method, ...] = ("tc", "sway_current")
WORLDS: dict[str, dict[str, Any]] = {
    "steady": {},
    "sheared": {"shear_east_mps_per_m": 0.002},
    "turning": {"turn_deg_per_h": 30.0},
}
"""What the current does beside being 0.3 m/s: it changes by 0.06 m/s over the depths, or turns by 5 degrees."""


def diving(current: dict[str, Any], **sections: dict[str, Any]) -> Simulation:
    """Tactical IMU, depth and heading; the bottom is lost after a minute."""
    content = load_scenario("straight").model_dump(exclude_unset=True)
    dvl = {key: value for key, value in content["dvl"].items() if key != "beams_lost"}
    lost = {"beams": [1, 2, 3, 4], "from_s": LOCK_S, "to_s": 1e6}
    mission = {
        "waypoints_m": [[0, 0], [500, 0], [500, 400], [0, 400], [0, 800]],
        "depth_profile": [[0, 20], [60, 20], [180, 50], [300, 20], [420, 50], [540, 20], [660, 50]],
        "duration_s": DURATION_S,
        "current": {"speed_mps": 0.3, "towards_deg": 40.0} | current,
    }
    content |= {"imu": {"grade": "tactical"}, "dvl": dvl | {"outages": [lost]}}
    content |= {"depth": {}, "heading": {"noise_deg": 0.5}}
    content |= {"trajectory": {"kind": "waypoints"}, "mission": mission}
    return build_simulation(Scenario.model_validate(content | sections))


def run(simulation: Simulation) -> dict[str, Any]:
    """At the end, (runs, methods): horizontal error, m, and normalised squared errors of two, three and six numbers."""
    key, truth = trajectory_key("water_track_campaign"), simulation.truth()
    model = simulation.scenario.kernel_model(simulation.gravity_mps2)
    plan: Any = measurement_schedule(simulation, truth, trajectory_key=key, runs=RUNS)
    arrays: Any = truth.kernel_arrays()
    batch = run_batch(
        simulation.geometry, arrays, model, model, simulation.scenario.kernel_options(), plan, METHODS,
        seed=1, trajectory_key=key, first_run=0, runs=RUNS, threads=1,
    )  # fmt: skip
    error, sd = batch["error"][:, :, -1], batch["sd"][:, :, -1]
    return {
        "error_m": np.hypot(error[..., 0], error[..., 1]),
        "position": np.sum((error[..., :2] / sd[..., :2]) ** 2, axis=-1),
        "velocity": np.sum((error[..., 6:9] / sd[..., 6:9]) ** 2, axis=-1),
        "attitude and velocity": batch["nees_velocity_attitude"][:, :, -1],
    }


@pytest.mark.parametrize("world", WORLDS)
def test_it_bounds_the_error_and_is_not_overconfident(world: str) -> None:
    """The filter has the current by depth with its default prior, which is conservative here."""
    current = WORLDS[world]
    with_it, without = run(diving(current, water_track={})), run(diving(current))
    medians = np.median(with_it["error_m"], axis=0), np.median(without["error_m"], axis=0)
    # Seen: 14 to 19 m; without it 3000 m of tc, and 33 to 46 m of sway_current, which coasts on its assumptions.
    assert (medians[0] < 23.0).all()
    assert medians[0][0] < 0.01 * medians[1][0]
    assert medians[0][1] < 0.8 * medians[1][1]
    for name, degrees in {"position": 2, "velocity": 3, "attitude and velocity": 6}.items():
        assert (with_it[name].mean(axis=0) < mean_band(degrees, RUNS, PROBABILITY)[1]).all(), name
