"""Sections of a scenario's TOML for missions, currents and seabeds; units are in the keys, SI comes out."""

import difflib
import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bottomlock.config.validation import explain
from bottomlock.errors import ScenarioError
from bottomlock.plant.actuators import StuckFin
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

Table = TypeVar("Table", bound=BaseModel)

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Speed = Annotated[float, Field(gt=0.0, le=50.0)]
Duration = Annotated[float, Field(gt=0.0, le=86_400.0)]
"""Seconds, a day at most: a mission is integrated step by step."""

Length = Annotated[float, Field(ge=0.1, le=1e6)]
"""Metres of a part of a path, of which a mission has a number that can be held."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class CurrentTable(_Table):
    """`[current]`: speed and the direction it sets towards, shear per metre of depth, Gauss-Markov wander."""

    speed_mps: NotNegative = 0.0
    towards_deg: Finite = 0.0
    shear_north_mps_per_m: Finite = 0.0
    shear_east_mps_per_m: Finite = 0.0
    wander_sd_mps: NotNegative = 0.0
    wander_time_s: Positive = 120.0
    seed: int = 0

    def build(self) -> Current:
        """The current, SI."""
        heading = math.radians(self.towards_deg)
        return Current(
            mean_mps=(self.speed_mps * math.cos(heading), self.speed_mps * math.sin(heading)),
            shear_ps=(self.shear_north_mps_per_m, self.shear_east_mps_per_m),
            wander_sd_mps=self.wander_sd_mps,
            wander_time_s=self.wander_time_s,
            seed=self.seed,
        )


class StuckFinTable(_Table):
    """`stuck_fin`: the number of the fin (1 to 4) and the angle it stands at."""

    fin: Annotated[int, Field(ge=1, le=4)]
    angle_deg: Finite


class _MissionTable(_Table):
    speed_mps: Speed = 2.0
    guidance: Literal["line_of_sight", "constant_bearing"] = "line_of_sight"
    current: CurrentTable = CurrentTable()
    stuck_fin: StuckFinTable | None = None


class StraightTable(_MissionTable):
    """Trajectory 1."""

    kind: Literal["straight"]
    duration_s: Duration = 250.0
    depth_m: NotNegative = 20.0

    def build(self) -> Mission:
        """The mission, without current and faults."""
        return straight(speed_mps=self.speed_mps, duration_s=self.duration_s, depth_m=self.depth_m)


class FigureEightTable(_MissionTable):
    """Trajectory 2."""

    kind: Literal["figure_eight"]
    duration_s: Duration = 250.0
    depth_m: NotNegative = 20.0
    radius_m: Length = 40.0
    dive_rate_mps: Finite = 0.1

    def build(self) -> Mission:
        """The mission, without current and faults."""
        return figure_eight(
            speed_mps=self.speed_mps,
            duration_s=self.duration_s,
            depth_m=self.depth_m,
            radius_m=self.radius_m,
            dive_rate_mps=self.dive_rate_mps,
        )


class LawnMowerTable(_MissionTable):
    """Trajectory 3."""

    kind: Literal["lawn_mower"]
    duration_s: Duration = 250.0
    depth_m: NotNegative = 20.0
    leg_m: Length = 80.0
    spacing_m: Length = 30.0
    dive_rate_mps: Finite = 0.3
    dive_duration_s: Duration = 30.0

    def build(self) -> Mission:
        """The mission, without current and faults."""
        return lawn_mower(
            speed_mps=self.speed_mps,
            duration_s=self.duration_s,
            depth_m=self.depth_m,
            leg_m=self.leg_m,
            spacing_m=self.spacing_m,
            dive_rate_mps=self.dive_rate_mps,
            dive_duration_s=self.dive_duration_s,
        )


class WaypointsTable(_MissionTable):
    """A user's trajectory: waypoints (north, east in m), rounded corners, depth at times."""

    kind: Literal["waypoints"]
    name: Annotated[str, Field(min_length=1)]
    waypoints_m: Annotated[list[tuple[Finite, Finite]], Field(min_length=2)]
    turn_radius_m: Length = 15.0
    depth_profile: Annotated[list[tuple[Finite, NotNegative]], Field(min_length=1)]
    duration_s: Duration | None = None

    def build(self) -> Mission:
        """The mission, without current and faults."""
        return waypoint_mission(
            self.name,
            np.array(self.waypoints_m),
            turn_radius_m=self.turn_radius_m,
            depth=DepthProfile(tuple(self.depth_profile)),
            speed_mps=self.speed_mps,
            duration_s=self.duration_s,
        )


AnyMission: TypeAlias = StraightTable | FigureEightTable | LawnMowerTable | WaypointsTable
_MISSIONS: dict[str, type[AnyMission]] = {
    "straight": StraightTable,
    "figure_eight": FigureEightTable,
    "lawn_mower": LawnMowerTable,
    "waypoints": WaypointsTable,
}


class FlatSeabedTable(_Table):
    """A plane: depth below the origin and slopes, positive where it deepens."""

    kind: Literal["plane"]
    depth_m: Positive
    slope_north_deg: Finite = 0.0
    slope_east_deg: Finite = 0.0


class RollingSeabedTable(_Table):
    """A synthetic grid of crossed undulations."""

    kind: Literal["rolling"]
    depth_m: Positive
    relief_m: NotNegative
    wavelength_m: Positive
    half_width_m: Positive = 600.0


class GridSeabedTable(_Table):
    """A user's grid file (.toml or .npz)."""

    kind: Literal["grid"]
    path: Path


AnySeabed: TypeAlias = FlatSeabedTable | RollingSeabedTable | GridSeabedTable
_SEABEDS: dict[str, type[AnySeabed]] = {
    "plane": FlatSeabedTable,
    "rolling": RollingSeabedTable,
    "grid": GridSeabedTable,
}


def mission_from_table(table: dict[str, Any], label: str) -> Mission:
    """Build a mission from its table.

    Raises:
        ScenarioError: naming the scenario `label` and every wrong key.

    >>> mission_from_table({"kind": "straight", "duration_s": 10}, "demo").duration_s
    10.0
    """
    read = _validated(_MISSIONS, table, f"scenario {label}: mission")
    stuck = read.stuck_fin
    mission: Mission = read.build()
    return replace(
        mission,
        law=read.guidance,
        current=read.current.build(),
        stuck=None if stuck is None else StuckFin(stuck.fin, math.radians(stuck.angle_deg)),
    )


def seabed_from_table(table: dict[str, Any], label: str) -> Seabed:
    """Build a seabed from its table.

    Raises:
        ScenarioError: naming the scenario `label` and every wrong key.
    """
    read = _validated(_SEABEDS, table, f"scenario {label}: seabed")
    if isinstance(read, FlatSeabedTable):
        north, east = (math.tan(math.radians(slope)) for slope in (read.slope_north_deg, read.slope_east_deg))
        return PlaneSeabed(read.depth_m, north, east)
    if isinstance(read, RollingSeabedTable):
        return rolling_seabed(
            depth_m=read.depth_m,
            relief_m=read.relief_m,
            wavelength_m=read.wavelength_m,
            half_width_m=read.half_width_m,
        )
    return load_grid(read.path)


def _validated(kinds: dict[str, type[Table]], table: dict[str, Any], place: str) -> Table:
    kind = table.get("kind")
    if kind not in kinds:
        close = difflib.get_close_matches(str(kind), kinds, n=1)
        hint = f", did you mean '{close[0]}'?" if close else f" (known: {', '.join(kinds)})"
        raise ScenarioError(f"{place}: 'kind' is {kind!r}{hint}")
    try:
        return kinds[kind].model_validate(table)
    except ValidationError as error:
        raise ScenarioError(explain(error, place, kinds[kind])) from error
