"""Paths: lines and arcs by one formula, waypoints with rounded corners, and a target that runs along."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bottomlock.errors import ScenarioError
from bottomlock.plant import DepthProfile, lawn_mower, load_vehicle
from bottomlock.plant.control import line_of_sight, offset_and_heading
from bottomlock.plant.maths import SCALAR
from bottomlock.plant.path import (
    PathBuilder,
    PathSegment,
    cross_track_m,
    guide_rows,
    target_along,
    through_waypoints,
)


@given(
    st.floats(-math.pi, math.pi),
    st.floats(5.0, 100.0),
    st.sampled_from([-1.0, 1.0]),
    st.floats(-1.2, 1.2),
    st.floats(-4.0, 4.0),
)
def test_offset_from_an_arc_is_distance_from_its_circle(
    heading: float, radius: float, side: float, turn: float, offset: float
) -> None:
    """Against geometry: the radius to the circle's centre, and the tangent at the foot of it."""
    segment = PathSegment(3.0, -2.0, heading, side / radius, 1000.0)
    north, east, tangent = segment.at(abs(turn) * radius)
    place = (north - offset * math.sin(tangent), east + offset * math.cos(tangent))
    found, direction = offset_and_heading(*place, segment.row(), SCALAR)
    assert found == pytest.approx(offset, abs=1e-9)
    assert math.remainder(direction - tangent, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("radius", [8.0, 20.0])
def test_waypoint_corners_are_rounded_and_joined(radius: float) -> None:
    points = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 80.0], [20.0, 80.0]])
    segments = through_waypoints(points, radius)
    for before, after in pairwise(segments):
        north, east, heading = before.at(before.length_m)
        assert (north, east) == pytest.approx((after.north_m, after.east_m), abs=1e-9)
        assert math.remainder(heading - after.heading_rad, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert segments[-1].at(segments[-1].length_m)[:2] == pytest.approx((20.0, 80.0))
    assert {round(1.0 / s.curvature_pm, 6) for s in segments if s.curvature_pm} == {radius}


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([[0.0, 0.0]], "at least two rows"),
        ([[0.0, 0.0], [0.0, 0.0]], "waypoint 2: equals waypoint 1"),
        ([[0.0, 0.0], [50.0, 0.0], [50.0, 5.0], [90.0, 5.0]], r"waypoint 3: the leg of 5\.0 m is too short"),
        ([[0.0, 0.0], [float("nan"), 1.0]], "finite"),
    ],
)
def test_impossible_waypoints_are_named(points: list[list[float]], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        through_waypoints(np.array(points), 10.0)


def test_target_runs_along_at_constant_speed() -> None:
    segments = PathBuilder(heading_rad=0.3).line(30.0).arc(10.0, math.pi).line(20.0).segments
    time = np.linspace(0.0, 60.0, 6001)
    target = target_along(segments, 2.0, time)
    steps = np.diff(target[:, :2], axis=0) / 0.01
    assert np.hypot(steps[:, 0], steps[:, 1]) == pytest.approx(2.0, abs=2e-3)
    assert np.allclose(steps, 0.5 * (target[1:, 2:4] + target[:-1, 2:4]), atol=5e-3)
    offset, _ = cross_track_m(segments, target[:4000, :2])
    assert np.abs(offset).max() < 1e-9


def test_the_command_is_continuous_over_every_joint() -> None:
    """The command does not depend on which of two neighbouring pairs is in use at a joint's end."""
    vehicle, mission = load_vehicle("tauv"), lawn_mower()
    law = line_of_sight(vehicle, 2.0, SCALAR)
    rows = guide_rows(mission.segments)
    nothing = (0.0,) * 5
    for index, segment in enumerate(mission.segments[1:5]):
        north, east, heading = segment.at(1.2)
        place = (north - 0.3 * math.sin(heading), east + 0.3 * math.cos(heading))
        late = law(*place, rows[index], nothing)
        early = law(*place, rows[index + 1], nothing)
        assert math.remainder(late[0] - early[0], 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
        assert late[1:] == pytest.approx(early[1:], abs=1e-12)


def test_depth_profiles_are_smooth_and_meet_their_rates() -> None:
    profile = DepthProfile(((5.0, 20.0), (35.0, 29.0)))
    time = np.linspace(0.0, 60.0, 60001)
    depth, sink = profile.at(time)
    assert np.abs(np.gradient(depth, time) - sink).max() < 1e-3
    assert sink[20000] == pytest.approx(0.3)
    assert (depth[0], depth[-1]) == pytest.approx((20.0, 29.0))
    assert np.abs(np.diff(sink)).max() < 2e-4


def test_depth_profiles_that_do_not_rise_in_time_are_refused() -> None:
    with pytest.raises(ScenarioError, match="strictly rising"):
        DepthProfile(((5.0, 20.0), (5.0, 29.0)))
