"""Ten minutes of water track after one minute of bottom and water, in campaigns: what it is worth, and consistency.

Every row of runs shares one flight, and so one current; an ensemble of currents is flown under an analytic motion.
A single sample of a seed that was not chosen; a band holds with probability 1 - 1e-3.
"""

from __future__ import annotations

from collections.abc import Sequence
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
STEADY = {"speed_mps": 0.3, "towards_deg": 40.0}


def scenario(**sections: dict[str, Any]) -> Simulation:
    """Tactical IMU, depth and heading; the bottom is lost after a minute."""
    content = load_scenario("straight").model_dump(exclude_unset=True)
    dvl = {key: value for key, value in content["dvl"].items() if key != "beams_lost"}
    lost = {"beams": [1, 2, 3, 4], "from_s": LOCK_S, "to_s": 1e6}
    content |= {"imu": {"grade": "tactical"}, "dvl": dvl | {"outages": [lost]}}
    content |= {"depth": {}, "heading": {"noise_deg": 0.5}}
    return build_simulation(Scenario.model_validate(content | sections))


def diving(current: dict[str, Any], **sections: dict[str, Any]) -> Simulation:
    """A vehicle that turns twice and goes between 20 and 50 m of depth."""
    mission = {
        "waypoints_m": [[0, 0], [500, 0], [500, 400], [0, 400], [0, 800]],
        "depth_profile": [[0, 20], [60, 20], [180, 50], [300, 20], [420, 50], [540, 20], [660, 50]],
        "duration_s": DURATION_S,
        "current": current,
    }
    return scenario(trajectory={"kind": "waypoints"}, mission=mission, **sections)


def run(
    simulation: Simulation, methods: Sequence[Method] = METHODS, *, first: int = 0, runs: int = RUNS
) -> dict[str, Any]:
    """At the end, (runs, methods): horizontal error, m, and normalised squared errors of two, three and six numbers."""
    key, truth = trajectory_key("water_track_campaign"), simulation.truth()
    model = simulation.scenario.kernel_model(simulation.gravity_mps2)
    plan: Any = measurement_schedule(simulation, truth, trajectory_key=key, first_run=first, runs=runs)
    arrays: Any = truth.kernel_arrays()
    batch = run_batch(
        simulation.geometry, arrays, model, model, simulation.scenario.kernel_options(), plan, methods,
        seed=1, trajectory_key=key, first_run=first, runs=runs, threads=1,
    )  # fmt: skip
    error, sd = batch["error"][:, :, -1], batch["sd"][:, :, -1]
    return {
        "error_m": np.hypot(error[..., 0], error[..., 1]),
        "position": np.sum((error[..., :2] / sd[..., :2]) ** 2, axis=-1),
        "velocity": np.sum((error[..., 6:9] / sd[..., 6:9]) ** 2, axis=-1),
        "attitude and velocity": batch["nees_velocity_attitude"][:, :, -1],
    }


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"shear_east_mps_per_m": 0.002},
        {"turn_deg_per_h": 30.0},
        {"turn_deg_per_h": 30.0, "shear_east_mps_per_m": 0.001},
    ],
    ids=["steady", "sheared", "turning", "both"],
)
def test_it_bounds_the_error_and_is_not_overconfident(change: dict[str, Any]) -> None:
    """0.3 m/s that stays, changes by 0.06 m/s over the depths, or turns by 5 degrees in the ten minutes.

    The filter has the current by depth with its default prior, which is conservative here.
    """
    with_it, without = run(diving(STEADY | change, water_track={})), run(diving(STEADY | change))
    medians = np.median(with_it["error_m"], axis=0), np.median(without["error_m"], axis=0)
    # Seen: 13 to 18 m; without it 3000 m of tc, and 33 to 46 m of sway_current, which coasts on its assumptions.
    assert (medians[0] < 23.0).all()
    assert medians[0][0] < 0.01 * medians[1][0]
    assert medians[0][1] < 0.8 * medians[1][1]
    for name, degrees in {"position": 2, "velocity": 3, "attitude and velocity": 6}.items():
        assert (with_it[name].mean(axis=0) < mean_band(degrees, RUNS, PROBABILITY)[1]).all(), name


def test_its_errors_are_as_claimed() -> None:
    """Currents from the filter's prior, one for each run, that stay. Seen: 2.1 of 2, 3.5 of 3, 6.2 of 6."""
    motion = {"kind": "lawn_mower", "source": "analytic", "duration_s": DURATION_S, "dive_angle_deg": 10.0}
    found: dict[str, list[float]] = {}
    for number in range(RUNS):
        north, east = np.random.default_rng(number).normal(0.0, 0.3, 2)
        drawn = {
            "speed_mps": float(np.hypot(north, east)),
            "towards_deg": float(np.degrees(np.arctan2(east, north))),
        }
        simulation = scenario(
            trajectory=motion | {"dive_s": 60.0, "leg_s": 120.0, "turn_s": 20.0},
            mission={},
            water_track={"current": drawn},
            filter={"water": {"current_time_s": 1e9}, "current_layers": {"sd_mps": 0.0}},
        )
        for name, values in run(simulation, ("tc",), first=number, runs=1).items():
            found.setdefault(name, []).append(float(values[0, 0]))
    for name, degrees in {"position": 2, "velocity": 3, "attitude and velocity": 6}.items():
        low, high = mean_band(degrees, RUNS, PROBABILITY)
        assert low < np.mean(found[name]) < high, name
