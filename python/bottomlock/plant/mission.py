"""Missions: path, depth profile, speed and duration; the 2017 paper's three trajectories and a user's own."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.plant.autopilot import StuckFin
from bottomlock.plant.current import Current
from bottomlock.plant.guidance import Law
from bottomlock.plant.maths import FloatArray
from bottomlock.plant.path import PathBuilder, PathSegment, target_along, through_waypoints

_BLEND_S = 4.0


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
        target = target_along(list(self.segments), self.speed_mps, time_s)
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
    return _mission("straight", path, DepthProfile(((0.0, depth_m),)), speed_mps, duration_s, current)


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
    return _mission("figure_eight", path, dive, speed_mps, duration_s, current)


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
    return _mission("lawn_mower", path, dive, speed_mps, duration_s, current)


def _mission(
    name: str,
    path: PathBuilder,
    depth: DepthProfile,
    speed_mps: float,
    duration_s: float,
    current: Current | None,
) -> Mission:
    """The mission along a path, by line of sight."""
    return Mission(name, tuple(path.segments), depth, speed_mps, duration_s, current=current or Current())


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
    return Mission(name, tuple(segments), depth, speed_mps, duration, law, current or Current())
