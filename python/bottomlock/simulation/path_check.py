"""Whether the rows of a path, and the motion through them, are those of a vehicle; and what the path is like."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bottomlock.config.trajectory import PathLimits
from bottomlock.errors import DataError
from bottomlock.io.track import Track
from bottomlock.truth import Array


@dataclass(frozen=True)
class Peak:
    """The greatest value of a quantity, with its time, s, and the last row before it."""

    value: float
    time_s: float
    row: int


def row_at(time_s: Array, at_s: float) -> int:
    """The last row at or before a time.

    >>> row_at(np.array([0.0, 1.0, 2.0]), 1.5)
    1
    """
    return int(np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, len(time_s) - 1))


WAYPOINTS = 'waypoints are flown with trajectory.kind = "waypoints"'
"""What a file of waypoints is refused with."""

_UNITS = (
    (1e-3, "is the time in ms (time_ms)? are positions in mm?"),
    (1e-6, "is the time in us (time_us)?"),
    (1e3, "are positions in km? is the time in ms (time_ms), not in s?"),
    (np.rad2deg(1.0), "are latitude and longitude in rad (latitude_rad, longitude_rad)?"),
)
"""By what the speed would be multiplied if a unit were another one, and which."""


DEGREE = 5
"""Of the splines through the rows."""
_GAP = 10.0
"""Times the median interval between rows: a longer one is a gap."""


def check_rows(track: Track, limits: PathLimits, *, max_gap_s: float | None) -> None:
    """Checks number, order, mean speed, the steps from row to row and the gaps between them.

    Args:
        track: the rows.
        limits: what is plausible.
        max_gap_s: longest time between two rows; None for ten times the median, and a second at least.

    Raises:
        DataError: naming the row and the likely mistake.
    """
    time_s = track.time_s
    if len(time_s) <= DEGREE:
        raise DataError(
            f"{len(time_s)} rows", place=track.place, expected=f"at least {DEGREE + 1}", hint=WAYPOINTS
        )
    _check_rising(time_s, track.place)
    steps_m, steps_s = np.linalg.norm(np.diff(track.position_t_m, axis=0), axis=1), np.diff(time_s)
    _check_units(track, steps_m, steps_s, limits)
    speed = steps_m / steps_s
    fast = np.flatnonzero(speed > limits.speed_mps)
    if fast.size:
        row = int(fast[0]) + 1
        raise DataError(
            f"row {row} is {steps_m[row - 1]:.3g} m from row {row - 1}, {steps_s[row - 1]:.3g} "
            f"s before ({speed[row - 1]:.3g} m/s)",
            place=track.place,
            expected=f"at most {limits.speed_mps:g} m/s: a jump in the file",
            hint="take the row out, or cut the file there (trajectory.limits.speed_mps)",
        )
    longest_s = max_gap_s or max(1.0, _GAP * float(np.median(steps_s)))
    gaps = np.flatnonzero(steps_s > longest_s)
    if gaps.size:
        row = int(gaps[0]) + 1
        raise DataError(
            f"row {row} is {steps_s[row - 1]:.3g} s after row {row - 1}",
            place=track.place,
            expected=f"at most {longest_s:.3g} s: a gap",
            hint=f"cut the file there, or set trajectory.max_gap_s; {WAYPOINTS}",
        )


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
            f"time is {step:g} s after that of row {row - 1}",
            place=f"{place}: row {row}",
            expected="it to rise",
            hint=likely,
        )


def _check_units(track: Track, steps_m: Array, steps_s: Array, limits: PathLimits) -> None:
    """Rejects a mean speed that another unit would make plausible."""
    mean = float(steps_m.sum() / steps_s.sum())
    usual = float(np.median(steps_m / steps_s))
    # Degrees so near zero may be radians: then every speed is 57 times too small.
    degrees = "latitude_deg" in track.columns and abs(track.latitude_rad or 0.0) < np.deg2rad(0.5 * np.pi)
    least = limits.least_speed_mps * (4.0 if degrees else 1.0)
    too_fast, too_slow = usual > limits.speed_mps, mean < least
    if not too_fast and not too_slow:
        return
    likely = [
        words for factor, words in _UNITS
        if limits.least_speed_mps <= (usual if too_fast else mean) * factor <= limits.speed_mps
        and (factor < 1.0) == too_fast and ("latitude" not in words or degrees)
    ]  # fmt: skip
    shown = f"{usual:.3g} m/s from row to row (median)" if too_fast else f"{mean:.3g} m/s on average"
    key, bound = ("speed_mps", f"at most {limits.speed_mps:g}") if too_fast else (
        "least_speed_mps", f"at least {least:g}"
    )  # fmt: skip
    raise DataError(
        f"rows 0 to {len(steps_m)}: {shown}",
        place=track.place,
        expected=f"{bound} m/s",
        hint=f"{' '.join(likely) or 'check the units'} (trajectory.limits.{key})",
    )


_ASTRAY_RAD = np.deg2rad(30.0)


def check_angles(track: Track, time_s: Array) -> None:
    """Rejects a yaw that follows the track only if its unit is the other one.

    Raises:
        DataError: naming the column.
    """
    yaw = track.angles_rad.get("yaw")
    if yaw is None or len(yaw) < 3:
        return
    north, east = np.gradient(track.position_t_m[:, 0], time_s), np.gradient(track.position_t_m[:, 1], time_s)
    moving = np.hypot(north, east) > 0.2
    if np.count_nonzero(moving) < 3:
        return
    course = np.arctan2(east, north)[moving]
    if np.hypot(np.cos(course).mean(), np.sin(course).mean()) > 0.95 and np.abs(course).mean() < _ASTRAY_RAD:
        # Northwards all the time, radians and degrees look alike.
        return
    name = next((one for one in track.columns if one.startswith(("yaw", "heading"))), None)
    if name is None:
        return
    other = np.rad2deg(yaw) if name.endswith("_deg") else np.deg2rad(yaw)
    if _astray(yaw[moving], course) > _ASTRAY_RAD >= _astray(other[moving], course):
        wrong, right = ("deg", "rad") if name.endswith("_deg") else ("rad", "deg")
        row = int(np.flatnonzero(moving)[0])
        raise DataError(
            f"from row {row} on {name} is off the direction of the track, and as {right} it is "
            f"not: call the column {name.removesuffix(wrong)}{right}",
            place=track.place,
        )


def _astray(yaw: Array, course: Array) -> float:
    """Median angle between heading and track."""
    return float(np.median(np.abs(np.angle(np.exp(1j * (yaw - course))))))


def check_smooth(place: str, peaks: Mapping[str, Peak], limits: PathLimits) -> None:
    """Checks speed, acceleration, jerk and turn rate of the motion.

    Raises:
        DataError: naming the row, and what makes such a motion.
    """
    bounds = {
        "speed": ("speed_mps", limits.speed_mps, 1.0, "m/s"),
        "acceleration": ("accel_mps2", limits.accel_mps2, 1.0, "m/s²"),
        "jerk": ("jerk_mps3", limits.jerk_mps3, 1.0, "m/s³"),
        "turn rate": ("turn_deg_per_s", limits.turn_deg_per_s, np.rad2deg(1.0), "deg/s"),
    }
    for name, (key, bound, scale, unit) in bounds.items():
        peak = peaks[name]
        if peak.value * scale > bound:
            raise DataError(
                f"{peak.time_s:.2f} s: {name} {peak.value * scale:.3g} {unit}",
                place=f"{place}: row {peak.row}",
                expected=(
                    f"at most {bound:g}: a jump in the file, or noise of a log, expected samples of "
                    "a smooth motion"
                ),
                hint=f"{WAYPOINTS}; trajectory.limits.{key} allows more",
            )


_DEG = float(np.rad2deg(1.0))


@dataclass(frozen=True)
class PathSummary:
    """A path at the IMU's rate.

    Attributes:
        place: the file.
        columns: what was read.
        rows: their number.
        duration_s: of what is flown.
        length_m: along the path.
        speed_mps: least, mean, greatest.
        depth_m: least and greatest.
        attitude: where it comes from.
        peaks: greatest "speed" (m/s), "acceleration" (m/s²), "jerk" (m/s³) and "turn rate" (rad/s).
    """

    place: str
    columns: tuple[str, ...]
    rows: int
    duration_s: float
    length_m: float
    speed_mps: tuple[float, float, float]
    depth_m: tuple[float, float]
    attitude: str
    peaks: Mapping[str, Peak]

    def lines(self) -> list[str]:
        """The summary as text."""
        low, mean, high = self.speed_mps

        def at(name: str, unit: str, scale: float = 1.0) -> str:
            peak = self.peaks[name]
            return f"{name} {peak.value * scale:.3g} {unit} (row {peak.row}, {peak.time_s:.1f} s)"

        extent = (
            f"{self.duration_s:.1f} s, {self.length_m:.1f} m, {low:.2f} to {high:.2f} m/s (mean {mean:.2f})"
        )
        return [
            f"{self.place}: {self.rows} rows of {', '.join(self.columns)}",
            f"{extent}, depth {self.depth_m[0]:.1f} to {self.depth_m[1]:.1f} m",
            f"attitude: {self.attitude}",
            f"greatest {at('acceleration', 'm/s²')}, {at('jerk', 'm/s³')}, {at('turn rate', 'deg/s', _DEG)}",
        ]
