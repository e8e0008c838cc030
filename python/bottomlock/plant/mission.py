"""Missions: path, depth profile, current, speed and duration; the 2017 paper's three and a user's own."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np
from scipy.interpolate import make_interp_spline

from bottomlock.config.mission_sections import AnyMission, CurrentTable, WaypointsTable
from bottomlock.errors import ScenarioError
from bottomlock.plant.control import Law, StuckFin
from bottomlock.plant.maths import FloatArray
from bottomlock.plant.path import PathBuilder, PathSegment, target_along, through_waypoints

_KNOTS_PER_TIME_CONSTANT = 10.0
_BLEND_S = 4.0


@dataclass(frozen=True)
class Current:
    """A horizontal current c(t, depth) = mean(t) + shear depth + wander(t), tangent frame, north and east.

    `mean_mps` is at the surface and at time 0, `shear_ps` per metre of depth. The mean turns at `turn_radps`, from
    north to east, as with a tide. The wander is a first-order Gauss-Markov process of standard deviation
    `wander_sd_mps` per axis and time constant `wander_time_s`, drawn from `seed`; it is sampled ten times per time
    constant and interpolated by a cubic spline, so that the vehicle's acceleration is smooth.

    Raises:
        ScenarioError: for a number that is not finite, a negative wander_sd_mps or a wander_time_s of 0 or less.
    """

    mean_mps: tuple[float, float] = (0.0, 0.0)
    shear_ps: tuple[float, float] = (0.0, 0.0)
    wander_sd_mps: float = 0.0
    wander_time_s: float = 120.0
    seed: int = 0
    turn_radps: float = 0.0

    def __post_init__(self) -> None:
        values = (*self.mean_mps, *self.shear_ps, self.wander_sd_mps, self.wander_time_s, self.turn_radps)
        if not all(math.isfinite(value) for value in values):
            raise ScenarioError("every number must be finite", place="current")
        if self.wander_sd_mps < 0.0 or self.wander_time_s <= 0.0:
            raise ScenarioError(
                "wander_sd_mps must not be negative and wander_time_s must be positive", place="current"
            )

    @classmethod
    def towards(cls, speed_mps: float, direction_rad: float) -> Self:
        """A constant current that sets towards a direction (rad from north, east positive)."""
        return cls(mean_mps=(speed_mps * math.cos(direction_rad), speed_mps * math.sin(direction_rad)))

    def columns(self, time_s: FloatArray) -> FloatArray:
        """Surface current (N, E), its rate of change (N, E) and the shear (N, E) at times, shape (n, 6)."""
        time = np.asarray(time_s, dtype=np.float64)
        table = np.zeros((len(time), 6))
        (north, east), turned = self.mean_mps, self.turn_radps * time
        sine, cosine = np.sin(turned), np.cos(turned)
        mean = np.column_stack([north * cosine - east * sine, north * sine + east * cosine])
        table[:, 0:2] = mean
        table[:, 2:4] = self.turn_radps * np.column_stack([-mean[:, 1], mean[:, 0]])
        table[:, 4:6] = self.shear_ps
        if self.wander_sd_mps > 0.0:
            spline = self._wander(float(time[-1]))
            table[:, 0:2] += spline(time)
            table[:, 2:4] += spline(time, 1)
        return table

    def _wander(self, duration_s: float) -> Callable[..., FloatArray]:
        spacing = self.wander_time_s / _KNOTS_PER_TIME_CONSTANT
        # knots at a spacing that does not depend on the duration: a longer run begins with the same current
        count = max(8, math.ceil(duration_s / spacing) + 5)
        memory = math.exp(-1.0 / _KNOTS_PER_TIME_CONSTANT)
        draws = np.random.default_rng([self.seed, 0xC0]).standard_normal((count, 2))
        knots = np.empty_like(draws)
        knots[0] = draws[0]
        for index in range(1, count):
            knots[index] = memory * knots[index - 1] + math.sqrt(1.0 - memory**2) * draws[index]
        times = spacing * (np.arange(count) - 1.0)
        spline: Callable[..., FloatArray] = make_interp_spline(times, self.wander_sd_mps * knots, k=3)
        return spline


@dataclass(frozen=True)
class DepthProfile:
    """Depth (m) at times (s), joined by constant rates; each change of rate is spread over four seconds."""

    knots: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        times = [time for time, _ in self.knots]
        if not self.knots or any(later <= earlier for earlier, later in pairwise(times)):
            raise ScenarioError(
                f"times {times}",
                place="depth profile",
                expected="at least one (time, depth) pair and strictly rising times",
            )

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Wanted depth (m) and sink rate (m/s) at times."""
        time = np.asarray(time_s, dtype=np.float64)
        knots = np.array(self.knots)
        slopes = np.concatenate([[0.0], np.diff(knots[:, 1]) / np.diff(knots[:, 0]), [0.0]])
        depth, sink = np.full_like(time, knots[0, 1]), np.zeros_like(time)
        for (start, _), change in zip(knots, np.diff(slopes), strict=True):
            # the integral of a smooth step 3 x² - 2 x³, so depth has a continuous second derivative
            x = np.clip((time - start) / _BLEND_S + 0.5, 0.0, 1.0)
            late = np.maximum((time - start) - 0.5 * _BLEND_S, 0.0)
            depth += change * (_BLEND_S * (x**3 - 0.5 * x**4) + late)
            sink += change * (3.0 * x**2 - 2.0 * x**3)
        return depth, sink


@dataclass(frozen=True)
class Mission:
    """A mission: path, depth profile, speed over ground (m/s), duration (s), guidance law, current, stuck fin.

    A heading (rad) is held throughout by a vehicle with thrusters; without one it points along its path.
    """

    name: str
    segments: tuple[PathSegment, ...]
    depth: DepthProfile
    speed_mps: float = 2.0
    duration_s: float = 250.0
    law: Law = "line_of_sight"
    current: Current = field(default_factory=Current)
    stuck: StuckFin | None = None
    heading_rad: float | None = None

    def timetable(self, time_s: FloatArray) -> FloatArray:
        """Inputs known before the run at the given times, shape (n, 13), in the layout of `model.FIELDS`."""
        depth, sink = self.depth.at(time_s)
        target = target_along(self.segments, self.speed_mps, time_s)
        return np.column_stack([self.current.columns(time_s), depth, sink, target])


def straight(
    *,
    speed_mps: float = 2.0,
    duration_s: float = 250.0,
    depth_m: float = 20.0,
    current: Current | None = None,
) -> Mission:
    """Trajectory 1: north at constant depth and speed."""
    path = PathBuilder().line(speed_mps * duration_s + 100.0)
    return Mission(
        "straight",
        path.segments,
        DepthProfile(((0.0, depth_m),)),
        speed_mps,
        duration_s,
        current=current or Current(),
    )


def figure_eight(
    *,
    speed_mps: float = 2.0,
    duration_s: float = 250.0,
    depth_m: float = 20.0,
    radius_m: float = 40.0,
    dive_rate_mps: float = 0.1,
    current: Current | None = None,
) -> Mission:
    """Trajectory 2: circles to the right and to the left in turn, diving at a constant rate all the way."""
    path = PathBuilder()
    loops = math.ceil(speed_mps * duration_s / (2.0 * math.pi * radius_m)) + 1
    for loop in range(loops):
        path.arc(radius_m, 2.0 * math.pi * (1.0 if loop % 2 == 0 else -1.0))
    ends_s = (-60.0, duration_s + 60.0)
    dive = DepthProfile(tuple((time_s, depth_m + dive_rate_mps * time_s) for time_s in ends_s))
    return Mission("figure_eight", path.segments, dive, speed_mps, duration_s, current=current or Current())


def lawn_mower(
    *,
    speed_mps: float = 2.0,
    duration_s: float = 250.0,
    depth_m: float = 20.0,
    leg_m: float = 80.0,
    spacing_m: float = 30.0,
    dive_rate_mps: float = 0.3,
    dive_duration_s: float = 30.0,
    current: Current | None = None,
) -> Mission:
    """Trajectory 3: a dive at constant rate for about 30 s on the way in, then legs at constant depth."""
    path = PathBuilder().line(speed_mps * (dive_duration_s + 5.0))
    legs = math.ceil(speed_mps * duration_s / leg_m) + 1
    for leg in range(legs):
        path.line(leg_m).arc(0.5 * spacing_m, math.pi * (1.0 if leg % 2 == 0 else -1.0))
    dive = DepthProfile(((2.0, depth_m), (2.0 + dive_duration_s, depth_m + dive_rate_mps * dive_duration_s)))
    return Mission("lawn_mower", path.segments, dive, speed_mps, duration_s, current=current or Current())


def waypoint_mission(
    name: str,
    waypoints_m: FloatArray,
    *,
    turn_radius_m: float,
    depth: DepthProfile,
    speed_mps: float = 2.0,
    duration_s: float | None = None,
    law: Law = "line_of_sight",
    current: Current | None = None,
) -> Mission:
    """Trajectory through waypoints (n, 2: north, east in m): straight legs with rounded corners.

    Without a duration the mission ends at the end of the path.

    Raises:
        ScenarioError: as `through_waypoints`.
    """
    segments = through_waypoints(waypoints_m, turn_radius_m)
    length = sum(segment.length_m for segment in segments)
    duration = length / speed_mps if duration_s is None else duration_s
    return Mission(name, segments, depth, speed_mps, duration, law, current or Current())


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
