"""Splines of degree 5 through the rows of a path: through each, fitted, or with rounded corners."""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline

from bottomlock.errors import DataError
from bottomlock.io.track import Track
from bottomlock.truth.path_check import Limits
from bottomlock.truth.truth import Array

DEGREE = 5
TURN_RADIUS_M = 15.0
"""Of waypoints; the default of `[mission]` too."""
_WINDOW_RADII = 2.0 / np.sqrt(0.5)
"""Window of the mean, taken twice, over turn radius: no right-angled corner is then tighter than that radius.

The part of the second leg in the velocity rises by at most one per window W. Half-way speed is √½ of that on the legs
and the course turns by 2 per window, so the radius is √½ W / 2.
"""
_POINTS = 16
"""Control points in a window."""
_GAP = 10.0
"""Times the median interval between rows: a longer one is a gap."""


@dataclass(frozen=True)
class PathOptions:
    """How the rows are flown.

    Attributes:
        speed_mps: along a track without times.
        smooth_s: distance of the knots that noisy rows are fitted on; None goes through every row.
        turn_radius_m: of the corners between waypoints; None where the rows are samples of a motion.
        max_gap_s: longest time between two samples; None for ten times the median, and a second at least.
        limits: what is plausible.
    """

    speed_mps: float | None = None
    smooth_s: float | None = None
    turn_radius_m: float | None = None
    max_gap_s: float | None = None
    limits: Limits = field(default_factory=Limits)

    def waypoints(self, track: Track) -> bool:
        """Whether the rows are waypoints joined by straight legs, not samples of a motion."""
        return track.time_s is None or self.turn_radius_m is not None

    def words(self, track: Track) -> str:
        """The way through the rows."""
        if self.waypoints(track):
            return f"straight legs between waypoints, corners of {self.turn_radius_m or TURN_RADIUS_M:g} m radius"
        if self.smooth_s is not None:
            return f"least squares on knots {self.smooth_s:g} s apart"
        return "through every row"

    def gap_s(self, time_s: Array) -> float:
        """The longest time between two samples."""
        return self.max_gap_s or max(1.0, _GAP * float(np.median(np.diff(time_s))))


def check_options(track: Track, options: PathOptions) -> None:
    """Checks that the options fit the file.

    Raises:
        DataError: naming the key.
    """
    place = track.place
    if track.time_s is None and options.speed_mps is None:
        raise DataError(f"{place}: has no times, expected trajectory.speed_mps, or a column time_s")
    if track.time_s is not None and options.speed_mps is not None:
        raise DataError(
            f"{place}: trajectory.speed_mps is given, but the file has times ({track.columns[0]}); leave it out"
        )
    if options.waypoints(track) and options.smooth_s is not None:
        raise DataError(
            f"{place}: trajectory.smooth_s is for rows that are samples of a motion, and these are waypoints; "
            "leave it out"
        )
    if options.waypoints(track) and track.angles_rad:
        raise DataError(
            f"{place}: has attitude ({', '.join(track.angles_rad)}), but attitude follows from the track between "
            "waypoints; leave out the columns, or give times and leave out trajectory.turn_radius_m"
        )


def row_times(track: Track, options: PathOptions) -> Array:
    """(n,) times of the rows, from 0; along a track without times at constant speed.

    Raises:
        DataError: for fewer than two rows, times that do not rise, and two waypoints in one place.
    """
    if len(track.position_t_m) < 2:
        raise DataError(f"{track.place}: 1 row, expected at least 2")
    if track.time_s is not None:
        _check_rising(track.time_s, track.place)
        return track.time_s
    steps = np.linalg.norm(np.diff(track.position_t_m, axis=0), axis=1)
    bad = np.flatnonzero(steps < 1e-3)
    if bad.size:
        raise DataError(
            f"{track.place}: point {bad[0] + 1} is in the place of point {bad[0]}; take one of them out, or give times"
        )
    assert options.speed_mps is not None
    return np.concatenate([[0.0], np.cumsum(steps) / options.speed_mps])


def _check_rising(time_s: Array, place: str) -> None:
    bad = np.flatnonzero(np.diff(time_s) <= 0.0)
    if bad.size:
        row = int(bad[0]) + 1
        step = float(time_s[row] - time_s[row - 1])
        likely = (
            "the row is there twice, or the times are rounded"
            if step == 0.0
            else "rows out of order, or two files joined"
        )
        raise DataError(
            f"{place}: row {row}: time is {step:g} s after that of row {row - 1}, expected it to rise; {likely}"
        )


def spline_through(
    place: str, time_s: Array, rows: Array, options: PathOptions, *, waypoints: bool
) -> BSpline:
    """A spline of degree 5 through rows (n, k) at their times (n,).

    Raises:
        DataError: for too few rows, and knots that no rows lie between.
    """
    if waypoints:
        return _rounded(time_s, rows, options.turn_radius_m or TURN_RADIUS_M)
    if len(rows) <= DEGREE:
        raise DataError(
            f"{place}: {len(rows)} rows, expected at least {DEGREE + 1}; if they are waypoints set "
            "trajectory.turn_radius_m"
        )
    if options.smooth_s is None:
        return make_interp_spline(time_s, rows, k=DEGREE)
    return _fitted(place, time_s, rows, options.smooth_s)


def _fitted(place: str, time_s: Array, rows: Array, smooth_s: float) -> BSpline:
    """Least squares on even knots, some `smooth_s` apart."""
    parts = max(1, round(float(time_s[-1]) / smooth_s))
    inner = np.linspace(0.0, time_s[-1], parts + 1)
    empty = np.flatnonzero(np.histogram(time_s, inner)[0] == 0)
    if empty.size:
        raise DataError(
            f"{place}: no row from {inner[empty[0]]:.2f} to {inner[empty[0] + 1]:.2f} s, expected one between any two "
            f"knots; trajectory.smooth_s is {smooth_s:g} s: set it longer"
        )
    knots = np.concatenate([np.zeros(DEGREE), inner, np.full(DEGREE, time_s[-1])])
    try:
        return make_lsq_spline(time_s, rows, knots, k=DEGREE)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise DataError(
            f"{place}: {len(rows)} rows do not determine {parts + DEGREE} numbers of a spline; trajectory.smooth_s is "
            f"{smooth_s:g} s: set it longer"
        ) from error


def _rounded(time_s: Array, rows: Array, turn_radius_m: float) -> BSpline:
    """A uniform B-spline whose control points are the legs, averaged twice: on them but for their corners."""
    steps = np.diff(rows, axis=0)
    speed_mps = float(np.linalg.norm(steps, axis=1).sum() / time_s[-1])
    intervals = max(1, int(_POINTS * time_s[-1] * speed_mps / (_WINDOW_RADII * turn_radius_m)))
    interval_s = float(time_s[-1]) / intervals
    weights = np.convolve(np.ones(_POINTS), np.ones(_POINTS)) / _POINTS**2
    # As many points lie before the first row as the mean and the spline reach, on the leg prolonged; so at the end.
    beyond = _POINTS - 1 + (DEGREE - 1) // 2
    leg_s = (np.arange(-beyond, intervals + beyond + 1)) * interval_s
    leg = np.clip(np.searchsorted(time_s, leg_s, side="right") - 1, 0, len(steps) - 1)
    fraction = (leg_s - time_s[leg]) / np.diff(time_s)[leg]
    legs = rows[leg] + fraction[:, None] * steps[leg]
    control = np.stack([np.convolve(axis, weights, mode="valid") for axis in legs.T], axis=1)
    knots = (np.arange(intervals + 2 * DEGREE + 1) - float(DEGREE)) * interval_s
    return BSpline(knots, control, DEGREE)
