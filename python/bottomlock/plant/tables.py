"""Missions, currents and seabeds from the sections of a scenario: SI comes out."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from bottomlock.config.mission_sections import (
    AnyMission,
    AnySeabed,
    CurrentTable,
    FlatSeabedTable,
    RollingSeabedTable,
    WaypointsTable,
)
from bottomlock.plant.autopilot import StuckFin
from bottomlock.plant.current import Current
from bottomlock.plant.mission import (
    DepthProfile,
    Mission,
    figure_eight,
    lawn_mower,
    straight,
    waypoint_mission,
)
from bottomlock.plant.seabed import PlaneSeabed, Seabed, load_grid, rolling_seabed

_PATHS: dict[str, Callable[..., Mission]] = {
    "straight": straight, "figure_eight": figure_eight, "lawn_mower": lawn_mower,
}  # fmt: skip


def mission_from_table(read: AnyMission, name: str, speed_mps: float, duration_s: float | None) -> Mission:
    """The mission of a section [mission]; only one through waypoints may be without duration.

    >>> from bottomlock.config.mission_sections import StraightTable
    >>> mission_from_table(StraightTable(), "demo", 2.0, 10.0).duration_s
    10.0
    """
    stuck = read.stuck_fin
    return replace(
        _path_of(read, {"speed_mps": speed_mps, "duration_s": duration_s}),
        name=name,
        law=read.guidance,
        current=current_from_table(read.current),
        stuck=None if stuck is None else StuckFin(stuck.fin, math.radians(stuck.angle_deg)),
        heading_rad=None if read.heading_deg is None else math.radians(read.heading_deg),
    )


def seabed_from_table(read: AnySeabed) -> Seabed:
    """The seabed of a section [seabed].

    Raises:
        ScenarioError: for a grid that cannot be read.
    """
    if isinstance(read, FlatSeabedTable):
        north, east = (math.tan(math.radians(slope)) for slope in (read.slope_north_deg, read.slope_east_deg))
        return PlaneSeabed(read.depth_m, north, east)
    if isinstance(read, RollingSeabedTable):
        return rolling_seabed(**read.model_dump(exclude={"kind"}))
    return load_grid(read.path)


def _path_of(read: AnyMission, timing: dict[str, Any]) -> Mission:
    """The mission of a table, without current and faults."""
    if isinstance(read, WaypointsTable):
        return waypoint_mission(
            read.kind,
            np.array(read.waypoints_m),
            turn_radius_m=read.turn_radius_m,
            depth=DepthProfile(tuple(read.depth_profile)),
            **timing,
        )
    own = read.model_dump(exclude={"kind", "guidance", "current", "stuck_fin", "heading_deg", *timing})
    return _PATHS[read.kind](**own, **timing)


def current_from_table(table: CurrentTable) -> Current:
    """The current, SI."""
    heading = math.radians(table.towards_deg)
    return Current(
        mean_mps=(table.speed_mps * math.cos(heading), table.speed_mps * math.sin(heading)),
        shear_ps=(table.shear_north_mps_per_m, table.shear_east_mps_per_m),
        wander_sd_mps=table.wander_sd_mps,
        wander_time_s=table.wander_time_s,
        seed=table.seed,
        turn_radps=math.radians(table.turn_deg_per_h) / 3600.0,
    )
