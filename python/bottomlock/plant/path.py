"""Paths in the horizontal plane: straight lines and arcs, and the target that moves along them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from bottomlock.errors import ScenarioError
from bottomlock.plant.control import offset_and_heading
from bottomlock.plant.maths import ARRAY, FloatArray, IntArray

_BLEND_M = 2.0


@dataclass(frozen=True)
class PathSegment:
    """A line or an arc of at most a quarter turn: start (m), heading (rad), curvature (1/m, right +)."""

    north_m: float
    east_m: float
    heading_rad: float
    curvature_pm: float
    length_m: float

    def row(self) -> tuple[float, float, float, float, float, float]:
        """The segment's start for guidance: north, east, cos, sin, heading, curvature."""
        heading = self.heading_rad
        return self.north_m, self.east_m, math.cos(heading), math.sin(heading), heading, self.curvature_pm

    def at(self, distance_m: float) -> tuple[float, float, float]:
        """North (m), east (m) and heading (rad) after a distance along the segment."""
        heading_change = self.curvature_pm * distance_m
        half = 0.5 * heading_change
        chord = distance_m * (1.0 if half == 0.0 else math.sin(half) / half)
        bearing = self.heading_rad + half
        return (
            self.north_m + chord * math.cos(bearing),
            self.east_m + chord * math.sin(bearing),
            self.heading_rad + heading_change,
        )


def guide_rows(segments: Sequence[PathSegment]) -> list[tuple[float, ...]]:
    """Per segment the input of guidance: its start, the next one's start, and the blend between them (m).

    After the last segment the path continues straight.
    """
    last = segments[-1]
    beyond = PathSegment(*last.at(last.length_m), 0.0, _BLEND_M * 4.0)
    rows: list[tuple[float, ...]] = []
    for present, following in pairwise([*segments, beyond]):
        blend = min(_BLEND_M, 0.5 * present.length_m, 0.5 * following.length_m)
        rows.append((*present.row(), *following.row(), blend))
    return rows


def next_segment(rows: Sequence[Sequence[float]], index: int, north_m: float, east_m: float) -> int:
    """Index of the segment to follow: advances past every joint that, with the blend over it, lies behind."""
    while index < len(rows) - 1:
        north, east, cosine, sine, _, _, blend = rows[index][6:]
        if cosine * (north_m - north) + sine * (east_m - east) < 0.5 * blend:
            break
        index += 1
    return index


class PathBuilder:
    """Lays segments end to end from a start."""

    def __init__(self, north_m: float = 0.0, east_m: float = 0.0, heading_rad: float = 0.0) -> None:
        self._pose = (north_m, east_m, heading_rad)
        self._laid: list[PathSegment] = []

    @property
    def segments(self) -> tuple[PathSegment, ...]:
        """The segments laid so far."""
        return tuple(self._laid)

    def line(self, length_m: float) -> Self:
        """Append a straight line."""
        return self._append(0.0, length_m)

    def arc(self, radius_m: float, turn_rad: float) -> Self:
        """Append an arc of an angle (rad), positive to the right, in pieces of at most a quarter turn."""
        pieces = max(1, math.ceil(abs(turn_rad) / (0.5 * math.pi) - 1e-9))
        for _ in range(pieces):
            self._append(math.copysign(1.0 / radius_m, turn_rad), radius_m * abs(turn_rad) / pieces)
        return self

    def _append(self, curvature: float, length: float) -> Self:
        segment = PathSegment(*self._pose, curvature, length)
        self._laid.append(segment)
        self._pose = segment.at(length)
        return self


def through_waypoints(waypoints_m: FloatArray, turn_radius_m: float) -> tuple[PathSegment, ...]:
    """Lines through waypoints (n, 2: north, east in m), corners rounded by arcs tangent to both legs.

    Raises:
        ScenarioError: naming the waypoint, for legs too short for the arc or a waypoint that repeats the one before.
    """
    points = np.asarray(waypoints_m, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise ScenarioError(place="waypoints", expected="at least two rows of finite north, east in metres")
    legs = np.diff(points, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    for repeated in np.flatnonzero(lengths <= 0.0):
        raise ScenarioError(
            f"equals waypoint {repeated + 1}",
            place=f"waypoint {repeated + 2}",
            expected="distinct positions",
            hint="remove one of them",
        )
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    turns = np.arctan2(np.sin(np.diff(headings)), np.cos(np.diff(headings)))
    cut = np.zeros(len(points))
    cut[1:-1] = turn_radius_m * np.tan(0.5 * np.abs(turns))
    builder = PathBuilder(float(points[0, 0]), float(points[0, 1]), float(headings[0]))
    for index, length in enumerate(lengths):
        straight = float(length - cut[index] - cut[index + 1])
        if straight < 0.0:
            raise ScenarioError(
                f"the leg of {length:.1f} m is too short for turns of radius {turn_radius_m:g} m",
                place=f"waypoint {index + 2}",
            )
        if straight > 0.0:
            builder.line(straight)
        if index < len(turns) and turns[index] != 0.0:
            builder.arc(turn_radius_m, float(turns[index]))
    return builder.segments


def target_along(segments: Sequence[PathSegment], speed_mps: float, time_s: FloatArray) -> FloatArray:
    """A target that moves along the path at constant speed, (n, 5).

    Columns: north, east (m), velocity north, east (m/s), course rate (rad/s). Beyond the last segment it continues on
    the last heading.
    """
    ends = np.cumsum([segment.length_m for segment in segments])
    distance = speed_mps * np.asarray(time_s)
    which = np.minimum(np.searchsorted(ends, distance, side="right"), len(segments) - 1)
    table = np.array([(s.north_m, s.east_m, s.heading_rad, s.curvature_pm, s.length_m) for s in segments])
    north, east, heading, curvature, length = table[which].T
    inside = distance - (ends[which] - length)
    on_path = np.minimum(inside, length)
    half = 0.5 * curvature * on_path
    chord = on_path * np.sinc(half / np.pi)
    bearing, leaving = heading + half, heading + 2.0 * half
    beyond = inside - on_path
    north = north + chord * np.cos(bearing) + beyond * np.cos(leaving)
    east = east + chord * np.sin(bearing) + beyond * np.sin(leaving)
    rate = np.where(beyond > 0.0, 0.0, speed_mps * curvature)
    return np.stack([north, east, speed_mps * np.cos(leaving), speed_mps * np.sin(leaving), rate], axis=1)


def cross_track_m(segments: Sequence[PathSegment], position_ne_m: FloatArray) -> tuple[FloatArray, IntArray]:
    """Distance to the path (n,), positive to the right, and the nearest segment's index (n,)."""
    points = np.asarray(position_ne_m, dtype=np.float64)
    best = np.full(len(points), np.inf)
    signed = np.full(len(points), np.nan)
    nearest = np.zeros(len(points), dtype=np.int64)
    for index, segment in enumerate(segments):
        north, east = points[:, 0] - segment.north_m, points[:, 1] - segment.east_m
        offset, heading = offset_and_heading(points[:, 0], points[:, 1], segment.row(), ARRAY)
        along = math.cos(segment.heading_rad) * north + math.sin(segment.heading_rad) * east
        curvature = segment.curvature_pm
        travelled = along if curvature == 0.0 else (heading - segment.heading_rad) / curvature
        overshoot = np.maximum(np.maximum(-travelled, travelled - segment.length_m), 0.0)
        gap = np.hypot(offset, overshoot)
        better = gap < best
        best, signed, nearest = (
            np.where(better, gap, best),
            np.where(better, np.copysign(gap, offset), signed),
            np.where(better, index, nearest),
        )
    return signed, nearest
