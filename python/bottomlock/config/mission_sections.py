"""The sections `[mission]` and `[seabed]` of a scenario, whose keys depend on their `kind`."""

from pathlib import Path
from typing import Annotated, Literal, TypeAlias, get_args

from pydantic import Field

from bottomlock.config.section import PackagedOrFile, Section, shown
from bottomlock.kernel.models import Finite, NonNegative, Positive, Real, Whole

Speed = Annotated[Real, Field(gt=0.0, le=50.0)]
Duration = Annotated[Real, Field(gt=0.0, le=86_400.0)]
"""Seconds, a day at most: a mission is integrated step by step."""

Length = Annotated[Real, Field(ge=0.1, le=1e6)]
"""Metres of a part of a path, of which a mission has a number that can be held."""


class CurrentTable(Section):
    """The current: mean speed and direction, its turn, shear with depth, and a Gauss-Markov variation."""

    speed_mps: NonNegative = 0.0
    """mean speed of the current"""
    towards_deg: Finite = 0.0
    """direction that it sets towards at the start, from north to east"""
    turn_deg_per_h: Finite = 0.0
    """rate at which the mean turns from north to east, as with a tide; the shear does not turn"""
    shear_north_mps_per_m: Annotated[Finite, shown(unit="m/s per m")] = 0.0
    """change of its north component with depth"""
    shear_east_mps_per_m: Annotated[Finite, shown(unit="m/s per m")] = 0.0
    """change of its east component with depth"""
    wander_sd_mps: NonNegative = 0.0
    """1 sigma of its variation, each component"""
    wander_time_s: Positive = 120.0
    """correlation time of its variation"""
    seed: Annotated[int, shown(unit="1")] = 0
    """seed of its variation"""


class StuckFinTable(Section):
    """A fin that is stuck at an angle."""

    fin: Annotated[Whole, Field(ge=1, le=4), shown(unit="1", example=2)]
    """number of the fin that is stuck"""
    angle_deg: Annotated[Finite, shown(example=5.0)]
    """angle at which it stands"""


class _MissionTable(Section):
    kind: str
    """the path; left out, that of [trajectory]"""
    speed_mps: Annotated[Speed | None, shown(example=2.0)] = None
    """speed over ground; none: that of [trajectory]"""
    duration_s: Annotated[Duration | None, shown(example=300.0)] = None
    """length of a run; none: that of [trajectory], and through waypoints to the end of the path without that"""
    guidance: Literal["line_of_sight", "constant_bearing"] = "line_of_sight"
    """law of guidance"""
    current: CurrentTable = CurrentTable()
    stuck_fin: StuckFinTable | None = None
    heading_deg: Annotated[Finite | None, shown(example=30.0)] = None
    """heading that a vehicle with thrusters holds; without it the vehicle points along its path"""


class _DivingTable(_MissionTable):
    depth_m: NonNegative = 20.0
    """depth, of a dive at its start"""


class StraightTable(_DivingTable):
    """Trajectory 1: north at constant depth."""

    kind: Literal["straight"] = "straight"


class FigureEightTable(_DivingTable):
    """Trajectory 2: circles to the right and to the left in turn, with a dive."""

    kind: Literal["figure_eight"] = "figure_eight"
    radius_m: Length = 40.0
    """radius of each circle"""
    dive_rate_mps: Finite = 0.1
    """sink rate throughout"""


class LawnMowerTable(_DivingTable):
    """Trajectory 3: a dive, then legs at constant depth joined by half turns."""

    kind: Literal["lawn_mower"] = "lawn_mower"
    leg_m: Length = 80.0
    """length of a leg"""
    spacing_m: Length = 30.0
    """distance between legs"""
    dive_rate_mps: Finite = 0.3
    """sink rate on the way in"""
    dive_duration_s: Duration = 30.0
    """length of the dive"""


class WaypointsTable(_MissionTable):
    """A user's trajectory: waypoints (north, east in m), rounded corners, depth at times."""

    kind: Literal["waypoints"] = "waypoints"
    name: Annotated[str | None, Field(min_length=1), shown(example="harbour")] = None
    """name of the path; results have that of the scenario"""
    waypoints_m: Annotated[
        list[tuple[Finite, Finite]],
        Field(min_length=2),
        shown(example=[[0.0, 0.0], [200.0, 0.0], [200.0, 80.0]]),
    ]
    """north and east of each waypoint"""
    turn_radius_m: Length = 15.0
    """radius of the corners"""
    depth_profile: Annotated[
        list[tuple[Finite, NonNegative]],
        Field(min_length=1),
        shown(unit="s, m", example=[[0.0, 5.0], [60.0, 20.0]]),
    ]
    """time (s) and depth (m) of each knot, joined by constant rates"""


AnyMission: TypeAlias = Annotated[
    StraightTable | FigureEightTable | LawnMowerTable | WaypointsTable,
    # Without its kind a table is like several of them.
    Field(discriminator="kind", json_schema_extra=lambda schema: schema.update(anyOf=schema.pop("oneOf"))),
]
MISSION_KINDS = {one.model_fields["kind"].default for one in get_args(get_args(AnyMission)[0])}


class FlatSeabedTable(Section):
    """A plane: depth below the origin and slopes, positive where it deepens."""

    kind: Literal["plane"]
    """a plane"""
    depth_m: Annotated[Positive, shown(example=72.0)]
    """depth of the bottom below the origin"""
    slope_north_deg: Finite = 0.0
    """slope, positive where it deepens northwards"""
    slope_east_deg: Finite = 0.0
    """slope, positive where it deepens eastwards"""


class RollingSeabedTable(Section):
    """A synthetic grid of crossed undulations."""

    kind: Literal["rolling"]
    """a made grid of crossed undulations"""
    depth_m: Annotated[Positive, shown(example=60.0)]
    """mean depth of the bottom"""
    relief_m: Annotated[NonNegative, shown(example=6.0)]
    """height of the undulations"""
    wavelength_m: Annotated[Positive, shown(example=120.0)]
    """their wavelength"""
    half_width_m: Positive = 600.0
    """distance from the origin to the grid's edge"""


class GridSeabedTable(Section):
    """A user's grid file (.toml or .npz)."""

    kind: Literal["grid"]
    """a grid of your own"""
    path: Annotated[Path, PackagedOrFile, shown(example="harbour.npz")]
    """file of the grid, TOML or npz, from the scenario's folder"""


AnySeabed: TypeAlias = Annotated[
    FlatSeabedTable | RollingSeabedTable | GridSeabedTable, Field(discriminator="kind")
]
