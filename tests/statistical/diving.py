"""Ten minutes without the bottom after one with bottom and water: a vehicle that turns and dives, in a current."""

from __future__ import annotations

from typing import Any

from bottomlock.config.scenario import Scenario, load_scenario
from bottomlock.simulation.build import Simulation, build_simulation

DURATION_S, LOCK_S = 660.0, 60.0
STEADY = {"speed_mps": 0.3, "towards_deg": 40.0}
WORLDS: dict[str, dict[str, Any]] = {
    "steady": {},
    "sheared": {"shear_east_mps_per_m": 0.002},
    "turning": {"turn_deg_per_h": 30.0},
    "both": {"turn_deg_per_h": 30.0, "shear_east_mps_per_m": 0.001},
}
"""What the current does beside being 0.3 m/s: it changes by 0.06 m/s over the depths, or turns by 5 degrees."""


DESCENT_S, DEEPEST_M = 900.0, 199.0
"""The packaged vehicle goes no deeper than 200 m."""


def scenario(**sections: dict[str, Any]) -> Scenario:
    """Tactical IMU, depth and heading; the bottom is lost after a minute."""
    content = load_scenario("straight").model_dump(exclude_unset=True)
    dvl = {key: value for key, value in content["dvl"].items() if key != "beams_lost"}
    lost = {"beams": [1, 2, 3, 4], "from_s": LOCK_S, "to_s": 1e6}
    content |= {"imu": {"grade": "tactical"}, "dvl": dvl | {"outages": [lost]}}
    content |= {"depth": {}, "heading": {"noise_deg": 0.5}}
    return Scenario.model_validate(content | sections)


def diving_scenario(current: dict[str, Any], **sections: dict[str, Any]) -> Scenario:
    """A vehicle that turns twice and goes between 20 and 50 m of depth."""
    mission = {
        "waypoints_m": [[0, 0], [500, 0], [500, 400], [0, 400], [0, 800]],
        "depth_profile": [[0, 20], [60, 20], [180, 50], [300, 20], [420, 50], [540, 20], [660, 50]],
        "duration_s": DURATION_S,
        "current": current,
    }
    return scenario(trajectory={"kind": "waypoints"}, mission=mission, **sections)


def diving(current: dict[str, Any], **sections: dict[str, Any]) -> Simulation:
    """The same, built."""
    return build_simulation(diving_scenario(current, **sections))


def descending(current: dict[str, Any], **sections: dict[str, Any]) -> Simulation:
    """A vehicle that goes down from the surface for a quarter of an hour, and has the bottom only then."""
    made = scenario().model_dump(exclude_unset=True)
    lost = {"beams": [1, 2, 3, 4], "from_s": 0.0, "to_s": DESCENT_S}
    mission = {
        "waypoints_m": [[0, 0], [2000, 0]],
        "depth_profile": [[0, 1], [DESCENT_S, DEEPEST_M]],
        "duration_s": DESCENT_S + 20.0,
        "current": current,
    }
    made |= {
        "dvl": made["dvl"] | {"outages": [lost]},
        "trajectory": {"kind": "waypoints"},
        "mission": mission,
    }
    return build_simulation(Scenario.model_validate(made | sections))
