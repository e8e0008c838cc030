"""Missions and seabeds from TOML tables: human units in, SI out, wrong keys named."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bottomlock.config.scenario import load_scenario
from bottomlock.errors import ScenarioError
from bottomlock.plant import Mission, straight
from bottomlock.plant.seabed import GridSeabed, PlaneSeabed, Seabed, seabed_from_table
from bottomlock.simulation.build import mission_of

SCENARIO = load_scenario("straight")


def flown(mission: dict[str, Any]) -> Mission:
    """The mission of a scenario with this table."""
    return mission_of(SCENARIO.replace({"trajectory": {"kind": mission["kind"]}, "mission": mission}))


def bottom(seabed: dict[str, Any]) -> Seabed:
    """The seabed of a scenario with this table."""
    table = SCENARIO.replace({"seabed": seabed}).seabed
    assert table is not None
    return seabed_from_table(table)


def test_defaults_are_those_of_the_python_functions() -> None:
    assert flown({"kind": "straight"}) == straight()


def test_a_full_waypoint_table() -> None:
    mission = flown(
        {
            "kind": "waypoints",
            "name": "harbour",
            "waypoints_m": [[0, 0], [100, 0], [100, 50]],
            "turn_radius_m": 12,
            "depth_profile": [[0, 5], [30, 8]],
            "guidance": "constant_bearing",
            "current": {"speed_mps": 0.3, "towards_deg": 90},
            "stuck_fin": {"fin": 3, "angle_deg": 4},
        },
    )
    assert mission.law == "constant_bearing"
    assert mission.current.mean_mps == pytest.approx((0.0, 0.3), abs=1e-15)
    assert mission.stuck is not None
    assert mission.stuck.angle_rad == pytest.approx(math.radians(4.0))
    assert mission.duration_s == pytest.approx((150.0 - (2.0 - math.pi / 2) * 12.0) / 2.0)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "spiral"}, "scenario straight: 'trajectory.kind' is 'spiral'"),
        ({"kind": "straight", "sped_mps": 2}, "unknown key 'mission.sped_mps', did you mean 'speed_mps'"),
        ({"kind": "straight", "speed_mps": -1}, "'mission.speed_mps' is -1, expected > 0.0 m/s"),
        (
            {"kind": "waypoints", "name": "x", "waypoints_m": [[0, 0]], "depth_profile": [[0, 1]]},
            "waypoints_m",
        ),
        ({"kind": "straight", "stuck_fin": {"fin": 5, "angle_deg": 0}}, r"stuck_fin\.fin"),
        ({"kind": "straight", "current": {"speed_mps": float("nan")}}, r"current\.speed_mps"),
    ],
)
def test_wrong_keys_are_named(table: dict[str, Any], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        flown(table)


def test_seabeds(tmp_path: Path) -> None:
    plane = bottom({"kind": "plane", "depth_m": 60, "slope_north_deg": 5})
    assert plane == PlaneSeabed(60.0, math.tan(math.radians(5.0)), 0.0)
    rolling = bottom({"kind": "rolling", "depth_m": 60, "relief_m": 4, "wavelength_m": 90})
    assert isinstance(rolling, GridSeabed)
    np.savez(tmp_path / "own.npz", north_m=rolling.north_m, east_m=rolling.east_m, depth_m=rolling.depth_m)
    own = bottom({"kind": "grid", "path": str(tmp_path / "own.npz")})
    assert isinstance(own, GridSeabed)
    with pytest.raises(ScenarioError, match=r"'seabed\.depth_m' is -60, expected > 0\.0 m"):
        bottom({"kind": "plane", "depth_m": -60})


@pytest.mark.parametrize(
    ("key", "value"),
    [("dive_duration_s", 1e300), ("leg_m", 1e-300), ("speed_mps", 1e300), ("duration_s", 1e300)],
)
def test_a_mission_that_nothing_can_hold(key: str, value: float) -> None:
    """A day, and a path of a countable number of parts: beyond that the key is named."""
    with pytest.raises(ScenarioError, match=key):
        flown({"kind": "lawn_mower", key: value})
