"""Missions and seabeds from TOML tables: human units in, SI out, wrong keys named."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bottomlock.errors import ScenarioError
from bottomlock.plant import straight
from bottomlock.plant.seabed import GridSeabed, PlaneSeabed
from bottomlock.plant.tables import mission_from_table, seabed_from_table


def test_defaults_are_those_of_the_python_functions() -> None:
    assert mission_from_table({"kind": "straight"}, "x") == straight()


def test_a_full_waypoint_table() -> None:
    mission = mission_from_table(
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
        "harbour",
    )
    assert mission.law == "constant_bearing"
    assert mission.current.mean_mps == pytest.approx((0.0, 0.3), abs=1e-15)
    assert mission.stuck is not None
    assert mission.stuck.angle_rad == pytest.approx(math.radians(4.0))
    assert mission.duration_s == pytest.approx((150.0 - (2.0 - math.pi / 2) * 12.0) / 2.0)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "spiral"}, "scenario bad: mission: 'kind' is 'spiral'"),
        ({"kind": "straight", "sped_mps": 2}, "unknown key 'sped_mps', did you mean 'speed_mps'"),
        ({"kind": "straight", "speed_mps": -1}, "'speed_mps' is -1, expected > 0.0 m/s"),
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
        mission_from_table(table, "bad")


def test_seabeds(tmp_path: Path) -> None:
    plane = seabed_from_table({"kind": "plane", "depth_m": 60, "slope_north_deg": 5}, "x")
    assert plane == PlaneSeabed(60.0, math.tan(math.radians(5.0)), 0.0)
    rolling = seabed_from_table({"kind": "rolling", "depth_m": 60, "relief_m": 4, "wavelength_m": 90}, "x")
    assert isinstance(rolling, GridSeabed)
    np.savez(tmp_path / "own.npz", north_m=rolling.north_m, east_m=rolling.east_m, depth_m=rolling.depth_m)
    own = seabed_from_table({"kind": "grid", "path": str(tmp_path / "own.npz")}, "x")
    assert isinstance(own, GridSeabed)
    with pytest.raises(ScenarioError, match=r"scenario x: seabed: 'depth_m' is -60, expected > 0\.0 m"):
        seabed_from_table({"kind": "plane", "depth_m": -60}, "x")


@pytest.mark.parametrize(
    ("key", "value"),
    [("dive_duration_s", 1e300), ("leg_m", 1e-300), ("speed_mps", 1e300), ("duration_s", 1e300)],
)
def test_a_mission_that_nothing_can_hold(key: str, value: float) -> None:
    """A day, and a path of a countable number of parts: beyond that the key is named."""
    with pytest.raises(ScenarioError, match=key):
        mission_from_table({"kind": "lawn_mower", key: value}, "lawn_mower")
