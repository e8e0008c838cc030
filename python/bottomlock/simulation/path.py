"""The truth along a user's own path: splines through its rows, with exact derivatives; what it says of a scenario.

Position is a spline of degree 5 in time through every row, so acceleration and jerk are continuous; so are roll, pitch
and yaw where the file has them. Otherwise heading is the direction of the track, pitch its slope, and roll is zero.
Specific force and angular rate follow from the splines' own derivatives (`simulation.analytic`).
"""

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from bottomlock.config.scenario import EARTH_RATE_RADPS, Scenario
from bottomlock.config.trajectory import PathLimits
from bottomlock.errors import DataError, ScenarioError
from bottomlock.io.track import Track, read_track
from bottomlock.simulation.analytic import Attitudes, ideal_inertial_readings, rate_tp, rotation_t_p
from bottomlock.simulation.path_check import (
    DEGREE,
    PathSummary,
    Peak,
    check_angles,
    check_rows,
    check_smooth,
    row_at,
)
from bottomlock.truth import Array, Truth, sample_times_ns

_STEEPEST_RAD = np.deg2rad(85.0)
_SLOWEST_MPS = 0.02
"""Slower over ground than this, the track has no direction."""


class Path:
    """A path as functions of time, s from its first row.

    Examples:
        >>> from pathlib import Path as File
        >>> t = np.arange(0.0, 10.0, 0.5)
        >>> rows = np.stack([2.0 * t, np.zeros_like(t), np.full_like(t, 5.0)], axis=1)
        >>> track = Track("line", t, rows, True, None, None, {}, ())
        >>> path = Path(track)
        >>> path.attitudes(np.array([3.0])).velocity_p_mps.round(9).tolist()
        [[2.0, 0.0, 0.0]]
    """

    def __init__(
        self,
        track: Track,
        limits: PathLimits | None = None,
        *,
        max_gap_s: float | None = None,
        depth_m: float = 0.0,
    ) -> None:
        """Checks the rows and lays the splines.

        Args:
            track: the rows, samples of a smooth motion.
            limits: what is plausible; those of an underwater vehicle by default.
            max_gap_s: longest time between two rows; None for ten times the median, and a second at least.
            depth_m: of a file without depths.

        Raises:
            DataError: for rows that are no path, each with row and likely mistake.
        """
        self.track = track
        self.limits = limits or PathLimits()
        self.time_s = track.time_s
        rows = track.position_t_m.copy()
        if not track.has_depth:
            rows[:, 2] = depth_m
        check_rows(track, self.limits, max_gap_s=max_gap_s)
        check_angles(track, self.time_s)
        self._position: BSpline = make_interp_spline(self.time_s, rows, k=DEGREE)
        self._angles: dict[str, BSpline] = {
            name: make_interp_spline(self.time_s, np.unwrap(values)[:, None], k=DEGREE)
            for name, values in track.angles_rad.items()
        }

    @property
    def duration_s(self) -> float:
        """From the first to the last row."""
        return float(self.time_s[-1])

    def numbers(self) -> list[Array]:
        """All numbers that decide the path: its splines' knots and coefficients."""
        splines = [self._position, *(self._angles[name] for name in sorted(self._angles))]
        return [part for spline in splines for part in (spline.t, spline.c)]

    def position_t_m(self, time_s: Array) -> Array:
        """(n, 3) north, east, down."""
        return np.asarray(self._position(time_s))

    def derivative(self, time_s: Array, order: int) -> Array:
        """(n, 3) derivative of the position: velocity, acceleration, jerk, tangent frame."""
        return np.asarray(self._position(time_s, nu=order))

    @property
    def attitude_words(self) -> str:
        """Where the attitude comes from."""
        missing = {"yaw": "heading along the track", "pitch": "pitch along the slope", "roll": "roll 0"}
        words = [f"{name} from the file" for name in self._angles]
        return ", ".join(words + [text for name, text in missing.items() if name not in self._angles])

    def attitudes(self, time_s: Array) -> Attitudes:
        """Attitude and velocity with their exact first derivatives, at times (n,).

        Raises:
            DataError: where the vehicle stands still and its heading is that of the track, and for pitch beyond 85 deg.
        """
        velocity, accel = self.derivative(time_s, 1), self.derivative(time_s, 2)
        level = np.hypot(velocity[:, 0], velocity[:, 1])
        slow = np.flatnonzero(level < _SLOWEST_MPS)
        if slow.size and not {"pitch", "yaw"} <= self._angles.keys():
            at = float(time_s[slow[0]])
            raise DataError(
                f"{level[slow[0]]:.3f} m/s over ground, so that the track gives no heading or pitch",
                place=self._at(at),
                hint="give the columns yaw_deg and pitch_deg, or cut the file here",
            )
        zero = np.zeros_like(time_s)
        roll, roll_rate = self._angle("roll", time_s, lambda: (zero, zero))
        pitch, pitch_rate = self._angle("pitch", time_s, lambda: _slope(velocity, accel, level))
        yaw, yaw_rate = self._angle("yaw", time_s, lambda: _course(velocity, accel, level))
        steep = np.flatnonzero(np.abs(pitch) > _STEEPEST_RAD)
        if steep.size:
            at = float(time_s[steep[0]])
            raise DataError(
                f"pitch {np.rad2deg(pitch[steep[0]]):.0f} deg",
                place=self._at(at),
                expected="at most 85 deg",
                hint="a track without attitude climbs this steeply where its depth jumps",
            )
        still = np.zeros((len(time_s), 3))
        state = Attitudes(roll, pitch, yaw, roll_rate, pitch_rate, yaw_rate, still, still)
        to_platform = rotation_t_p(state).inv()
        velocity_p = to_platform.apply(velocity)
        omega = rate_tp(roll, pitch, roll_rate, pitch_rate, yaw_rate)
        accel_p = to_platform.apply(accel) - np.cross(omega, velocity_p)
        return Attitudes(roll, pitch, yaw, roll_rate, pitch_rate, yaw_rate, velocity_p, accel_p)

    def _at(self, time_s: float) -> str:
        return f"{self.track.place}: row {row_at(self.time_s, time_s)}, {time_s:.2f} s"

    def _angle(
        self, name: str, time_s: Array, otherwise: Callable[[], tuple[Array, Array]]
    ) -> tuple[Array, Array]:
        """An angle of the file, or that of the track, and its rate."""
        spline = self._angles.get(name)
        return otherwise() if spline is None else (spline(time_s)[:, 0], spline(time_s, nu=1)[:, 0])


def _course(velocity: Array, accel: Array, level: Array) -> tuple[Array, Array]:
    """Direction of the track over ground, and its rate."""
    north, east = velocity[:, 0], velocity[:, 1]
    return np.arctan2(east, north), (north * accel[:, 1] - east * accel[:, 0]) / level**2


def _slope(velocity: Array, accel: Array, level: Array) -> tuple[Array, Array]:
    """Slope of the track, positive upwards, and its rate."""
    down, gathered = velocity[:, 2], np.sum(velocity[:, :2] * accel[:, :2], axis=1) / level
    return np.arctan2(-down, level), (down * gathered - level * accel[:, 2]) / (level**2 + down**2)


def path_truth(
    path: Path,
    *,
    rate_hz: float,
    latitude_rad: float,
    gravity_mps2: float,
    earth_rate_radps: float,
    duration_s: float | None = None,
) -> tuple[Truth, PathSummary]:
    """The truth along a path at the IMU's rate, and what it is like.

    Raises:
        DataError: for a duration beyond the last row or shorter than a sample, and a motion that is not plausible, with
            the row where it is worst.
    """
    wanted_s = path.duration_s if duration_s is None else duration_s
    if wanted_s > path.duration_s + 1e-9:
        raise DataError(
            f"lasts {path.duration_s:.3f} s",
            place=path.track.place,
            expected=f"at least the {wanted_s:g} s of trajectory.duration_s",
        )
    time_ns = sample_times_ns(wanted_s, rate_hz)
    if len(time_ns) < 2:
        raise DataError(f"lasts {wanted_s:g} s, shorter than one IMU interval", place=path.track.place)
    time_s = np.asarray(time_ns * 1e-9, np.float64)
    state = path.attitudes(time_s)
    summary = summarised(path, time_s, state)
    check_smooth(path.track.place, summary.peaks, path.limits)
    omega, force = ideal_inertial_readings(
        state, latitude_rad=latitude_rad, gravity_mps2=gravity_mps2, earth_rate_radps=earth_rate_radps
    )
    truth = Truth(
        time_ns=time_ns,
        position_t_m=np.ascontiguousarray(path.position_t_m(time_s)),
        attitude_t_p=np.ascontiguousarray(rotation_t_p(state).as_quat()[:, [3, 0, 1, 2]]),
        velocity_p_mps=np.ascontiguousarray(state.velocity_p_mps),
        omega_p_radps=np.ascontiguousarray(omega),
        force_p_mps2=np.ascontiguousarray(force),
        latitude_rad=latitude_rad,
        gravity_mps2=gravity_mps2,
    )
    return truth, summary


def truth_from_path(
    file: str | FilePath,
    *,
    rate_hz: float,
    gravity_mps2: float,
    latitude_rad: float | None = None,
    depth_m: float = 0.0,
    columns: Mapping[str, str] | None = None,
    earth_rate_radps: float = EARTH_RATE_RADPS,
    max_gap_s: float | None = None,
    limits: PathLimits | None = None,
) -> Truth:
    """The truth along a path from a file, as `[trajectory] file` flies it (docs/own_trajectory.md).

    Args:
        file: CSV or Parquet (`io.track`).
        rate_hz: rate of the samples.
        gravity_mps2: local gravity.
        latitude_rad: where the file has none; otherwise the file's.
        depth_m: of a file without depths.
        columns: the file's names of columns.
        earth_rate_radps: 0 for an Earth that stands still.
        max_gap_s, limits: as of `Path`.

    Raises:
        DataError: for rows that are no path, a motion that is not plausible, and a latitude that is nowhere.
    """
    path = Path(read_track(FilePath(file), columns), limits, max_gap_s=max_gap_s, depth_m=depth_m)
    latitude = path.track.latitude_rad if latitude_rad is None else latitude_rad
    if latitude is None:
        raise DataError("has no latitude", place=file, expected="latitude_rad, for the rate of the Earth")
    truth, _ = path_truth(
        path,
        rate_hz=rate_hz,
        latitude_rad=latitude,
        gravity_mps2=gravity_mps2,
        earth_rate_radps=earth_rate_radps,
    )
    return truth


def summarised(path: Path, time_s: Array, state: Attitudes) -> PathSummary:
    """Length, speeds and greatest derivatives of a path at times (n,)."""
    speed = np.linalg.norm(state.velocity_p_mps, axis=1)
    depth = path.position_t_m(time_s)[:, 2]
    turn = rate_tp(state.roll_rad, state.pitch_rad, state.roll_rate, state.pitch_rate, state.yaw_rate)
    measured = {
        "speed": speed,
        "acceleration": np.linalg.norm(path.derivative(time_s, 2), axis=1),
        "jerk": np.linalg.norm(path.derivative(time_s, 3), axis=1),
        "turn rate": np.linalg.norm(turn, axis=1),
    }
    peaks = {}
    for name, values in measured.items():
        at = int(np.argmax(values))
        peaks[name] = Peak(float(values[at]), float(time_s[at]), row_at(path.time_s, float(time_s[at])))
    return PathSummary(
        place=path.track.place,
        columns=path.track.columns,
        rows=len(path.time_s),
        duration_s=float(time_s[-1]),
        length_m=float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time_s))),
        speed_mps=(float(speed.min()), float(speed.mean()), float(speed.max())),
        depth_m=(float(depth.min()), float(depth.max())),
        attitude=path.attitude_words,
        peaks=peaks,
    )


_LATITUDE_TOLERANCE_DEG = 0.1
"""Of a latitude that the scenario states as well: gravity and Earth rate differ by some 1e-5 and 1e-3 of themselves."""


def own_path(scenario: Scenario) -> Path:
    """The path of a scenario with `trajectory.file`.

    Raises:
        ScenarioError: for a file that cannot be read or is no path, naming scenario, file, row and likely mistake; and
            for a speed beside it.
    """
    settings = scenario.trajectory
    assert settings.file is not None
    if "speed_mps" in settings.model_fields_set:
        raise ScenarioError(
            f"is given, but the times of {settings.file} state the speed",
            place=f"scenario {scenario.name}",
            key="trajectory.speed_mps",
            hint="leave it out",
        )
    try:
        return Path(
            read_track(FilePath(settings.file), settings.columns),
            settings.limits,
            max_gap_s=settings.max_gap_s,
            depth_m=scenario.environment.depth_m,
        )
    except DataError as error:
        raise ScenarioError(f"trajectory.file: {error}", place=f"scenario {scenario.name}") from error


def with_path(scenario: Scenario, path: Path) -> Scenario:
    """The scenario with the duration of its path and, of a file in degrees, its latitude and longitude.

    What the scenario states itself stays.

    Raises:
        ScenarioError: for a latitude that is not that of the file.
    """
    if "duration_s" not in scenario.trajectory.model_fields_set:
        scenario = scenario.with_trajectory(duration_s=path.duration_s)
    if path.track.latitude_rad is None or path.track.longitude_rad is None:
        return scenario
    latitude_deg, longitude_deg = np.rad2deg([path.track.latitude_rad, path.track.longitude_rad]).tolist()
    environment = scenario.environment
    stated = environment.model_fields_set
    if "latitude_deg" in stated and abs(environment.latitude_deg - latitude_deg) > _LATITUDE_TOLERANCE_DEG:
        raise ScenarioError(
            f"is {environment.latitude_deg:g}, but {path.track.place} begins at {latitude_deg:.4f}",
            place=f"scenario {scenario.name}",
            key="environment.latitude_deg",
            hint="leave the key out",
        )
    found = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    update = {key: value for key, value in found.items() if key not in stated}
    return scenario.model_copy(update={"environment": environment.model_copy(update=update)})


def resolved(scenario: Scenario) -> Scenario:
    """The scenario with what its trajectory's file says of it; any other as it is.

    Raises:
        ScenarioError: as `own_path` and `with_path`.

    >>> from bottomlock.config.scenario import load_scenario
    >>> scenario = load_scenario("straight")
    >>> resolved(scenario) is scenario
    True
    """
    return with_path(scenario, own_path(scenario)) if scenario.trajectory.source == "file" else scenario
