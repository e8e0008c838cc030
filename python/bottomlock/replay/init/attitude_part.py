"""The attitude of a first case: unit, frames and clock by its own rate against the gyros, or turns in their place."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.arrays import rising
from bottomlock.errors import DataError
from bottomlock.recordings.attitude_motion import inertial_readings
from bottomlock.recordings.axes import from_angles, platform_attitude
from bottomlock.recordings.streams import Flags, Floats, Integers, integrator
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import NOTHING, Guess, angle_unit
from bottomlock.replay.init.imu_part import ImuPart

FRAMES = ("ned_frd", "enu_flu")
TURNS, APART = 0.4, 0.1
"""Correlation of the rates with the gyros' from which they decide, and by how much it exceeds that of the other."""
NEAR = (0.5, 2.0)
"""Slopes of the rates over the gyros' from which the unit is right."""
OFFSET_S = 0.1
"""Smaller clock offsets of an attitude are not set."""


@dataclass(frozen=True)
class AttitudeMatch:
    """How an attitude compares with gyros.

    Attributes:
        frame: "ned_frd" or "enu_flu".
        correlation: of the rates, at the best clock offset.
        other: correlation of the other frame.
        slope: of the attitude's rate over the gyros': 1, or a wrong unit.
        offset_s: to add to the attitude's times.
        least: smallest correlation of a single axis that turns enough to tell.
        quarters: of a turn, from the attitude sensor's forward to starboard, by which its axes stand on the platform.
        level: correlation of roll and pitch rates at that turn.
    """

    frame: str
    correlation: float
    other: float
    slope: float
    offset_s: float
    least: float
    quarters: int = 0
    level: float = 0.0

    @property
    def clear(self) -> bool:
        """Whether the rates decide."""
        return self.correlation > TURNS and self.correlation > self.other + APART


@dataclass(frozen=True, eq=False)
class AttitudePart:
    """An attitude as guessed: its table has angles, or (`rpy_rad` written again) quaternions."""

    found: Found
    rpy_rad: Floats
    unit: Guess
    match: AttitudeMatch | None
    offset: Guess
    declination: Guess = NOTHING

    @property
    def quarters(self) -> int:
        """Quarter turns from the sensor's axes to the platform's."""
        return self.match.quarters if self.match is not None and self.match.clear else 0

    def platform(self) -> tuple[Integers, Rotation]:
        """Rising times on the IMU's clock, and attitudes of the platform."""
        times = self.found.times.time_ns
        assert times is not None  # guessed from them
        good = np.isfinite(self.rpy_rad).all(axis=1) & rising(times)
        mounting = np.array([0.0, 0.0, 0.5 * np.pi * self.quarters])
        attitude = platform_attitude(
            from_angles(*self.rpy_rad[good].T), self.frame.value, mounting, self.declination.value
        )
        return times[good] + round(self.offset.value * 1e9), attitude

    @property
    def frame(self) -> Guess:
        """Frames of the angles."""
        if self.match is None:
            return Guess("ned_frd", "too few rows overlap the gyros", known=False)
        if not self.match.clear:
            both = f"{self.match.correlation:.2f} and {self.match.other:.2f}"
            return Guess("ned_frd", f"the gyros do not decide (correlation {both})", known=False)
        why = f"its rates follow the gyros with a correlation of {self.match.correlation:.2f}"
        return Guess(self.match.frame, f"{why}, {self.match.other:.2f} in the other frames")


ORDERS = {"first": -1, "last": 0}
"""Places of the scalar among four numbers, and what rolls them to x, y, z, w."""
LEVEL_RAD = np.deg2rad(25.0)
"""Median tilt against the accelerometers that is a vehicle's own; in the wrong order it follows the heading."""


WHOLE_DEG = 360.5
"""Largest roll or pitch in degrees."""


def angles_of(found: Found, imu: ImuPart | None = None, offset: Guess = NOTHING) -> tuple[Floats, Guess]:
    """(n, 3) roll, pitch, yaw, rad, of angles or quaternions, NaN where there is none, and the unit of the angles.

    Which of four numbered columns is the scalar is told by the gyros, else by gravity, of a vehicle that is about
    level; where neither tells it, it is a question.

    Args:
        found: angles or a quaternion.
        imu: to hold numbered columns against; None without one, whose vehicle is taken to be level.
        offset: of the clock to the IMU's.
    """
    if "q0" not in found.columns:
        angles = found.values("roll", "pitch", "yaw")
        unit = angle_unit(angles, found.units.get("yaw", ""))
        steepest = float(np.nanmax(np.abs(angles[:, :2])))
        if unit.value == "deg" and steepest > WHOLE_DEG:
            raise DataError(
                f"has a roll or pitch of {steepest:.4g}", place=found.table.path, expected="radians or degrees",
                hint="are these hundredths of a degree? Divide by 100",
            )  # fmt: skip
        return angles * (np.pi / 180.0 if unit.value == "deg" else 1.0), unit
    q = found.values("q0", "q1", "q2", "q3")
    size = np.linalg.norm(q, axis=1)
    good = np.isfinite(size) & (size > 0.5)
    rpy = np.full((len(ORDERS), len(q), 3), np.nan)
    for k, turned in enumerate(ORDERS.values()):
        rpy[k, good] = Rotation.from_quat(np.roll(q[good], turned, axis=1)).as_euler("ZYX")[:, ::-1]
    if "numbered" not in found.extra:
        return rpy[0], Guess("rad", "")
    chosen, why, known = _scalar(found, rpy, imu, offset)
    words = f"of the quaternion the {list(ORDERS)[chosen]} column is the scalar: {why}"
    return rpy[chosen], Guess("rad", words, known=known)


def _scalar(found: Found, rpy: Floats, imu: ImuPart | None, offset: Guess) -> tuple[int, str, bool]:
    """Which of both orders (2, n, 3) it is, why, and whether that is known."""
    times, down = found.times.time_ns, np.array([0.0, 0.0, 1.0])
    if imu is not None and not imu.made and times is not None:
        times = times + round(offset.value * 1e9)
        matches = [match_attitude(times, one, imu.time_ns, imu.omega_p_radps) for one in rpy]
        fits = [-1.0 if one is None else one.correlation for one in matches]
        best = int(np.argmax(fits))
        if fits[best] > TURNS and fits[best] > fits[1 - best] + APART:
            return (
                best,
                f"so it turns with the gyros, correlation {fits[best]:.2f}, else {fits[1 - best]:.2f}",
                True,
            )
        down = -imu.force_p_mps2.mean(axis=0)
    tilts = np.array([_tilt(one[np.isfinite(one).all(axis=1)], down) for one in rpy])
    best = int(np.argmin(tilts))
    words = f"{np.rad2deg(tilts[best]):.0f} deg off gravity, else {np.rad2deg(tilts[1 - best]):.0f}"
    if tilts[best] < LEVEL_RAD < tilts[1 - best]:
        return best, f"so it is {words}", True
    return 0, f"neither gyros nor gravity tell it ({words})", False


def _tilt(rpy: Floats, down: Floats) -> float:
    """Median angle between the vertical of an attitude (n, 3), in the better of both frames, and a direction, rad."""
    attitudes = [platform_attitude(from_angles(*rpy.T), frame, np.zeros(3), 0.0) for frame in FRAMES]
    size = max(float(np.linalg.norm(down)), 1e-9)
    cosines = [float(np.median(one.inv().apply([0.0, 0.0, 1.0]) @ down)) / size for one in attitudes]
    return float(np.arccos(np.clip(max(cosines), -1.0, 1.0)))


def guess_attitude(found: Found, imu: ImuPart, offset: Guess) -> AttitudePart | None:
    """Unit, frames and clock of an attitude, from an offset of its clock; None where it has no times."""
    times = found.times.time_ns
    if times is None:
        return None
    rpy, unit = angles_of(found, imu, offset)
    match = match_attitude(times + round(offset.value * 1e9), rpy, imu.time_ns, imu.omega_p_radps)
    if match is not None and match.clear:
        if not unit.known and match.slope < 0.1 and "q0" not in found.columns:
            times_as_large = 1.0 / max(match.slope, 1e-9)
            unit = Guess(
                "deg", f"in radians its rates would be {times_as_large:.0f} times those of the gyros"
            )
            rpy = np.deg2rad(rpy)
        elif not unit.known and "q0" not in found.columns and NEAR[0] < match.slope < NEAR[1]:
            why = f"{unit.why}, and its rates are {match.slope:.2f} times those of the gyros"
            unit = Guess(unit.value, why)
        if abs(match.offset_s) > OFFSET_S and found.times is not imu.found.times:
            why = f"its turn rates fit the gyros' best when moved by {match.offset_s:+.2f} s"
            offset = Guess(offset.value + match.offset_s, why)
    return AttitudePart(found, rpy, unit, match, offset)


FEWEST = 50
"""Attitudes that make a motion."""


def imu_of_attitude(attitudes: list[Found]) -> ImuPart | None:
    """Turns of the attitude with the most rows, in place of an IMU for the guesses of other streams; None for too few.

    The frames of the angles are taken to be north-east-down and forward-starboard-down: there are no gyros that tell.
    """
    if not attitudes:
        return None
    found = max(attitudes, key=lambda one: one.table.frame.height)
    times = found.times.time_ns
    assert times is not None  # the caller's choice
    rpy, _ = angles_of(found)
    rows = np.flatnonzero(np.isfinite(rpy).all(axis=1) & rising(times))
    if len(rows) < FEWEST:
        return None
    time_ns, attitude = times[rows], from_angles(*rpy[rows].T)
    still = np.zeros((len(rows), 3))
    readings = inertial_readings(time_ns, attitude, still, latitude_rad=0.0)
    return ImuPart(
        found=found, time_ns=time_ns, rows=rows, force_s_mps2=still, omega_s_radps=readings.omega_p_radps,
        force=Guess("m/s2", ""), omega=Guess("rad/s", ""), increments=False, axes=np.eye(3), axes_why="",
        axes_known=True, rate_hz=1e9 / float(np.median(np.diff(time_ns))), made=True,
    )  # fmt: skip


LAGS_S = 3.0
LAG_STEP_S = 0.05
LEVEL = 0.5
"""Correlation of roll and pitch rates from which they tell how an attitude sensor stands."""
OFF_QUARTER_DEG = 20.0
TURNS_BY_QUARTERS = np.round(
    Rotation.from_euler("Z", 90.0 * np.arange(4.0)[:, None], degrees=True).as_matrix()
)
"""(4, 3, 3) turns about the vertical."""


def match_attitude(
    time_ns: Integers, rpy_rad: Floats, imu_time_ns: Integers, omega_p_radps: Floats
) -> AttitudeMatch | None:
    """Compares an attitude with gyros, in both frames and at every clock offset of a few seconds.

    Args:
        time_ns, rpy_rad: (n,), (n, 3).
        imu_time_ns, omega_p_radps: (m,), (m, 3), platform axes.
    """
    keep = np.isfinite(rpy_rad).all(axis=1) & np.concatenate([[True], np.diff(time_ns) > 0])
    time_ns, rpy_rad = time_ns[keep], rpy_rad[keep]
    every = max(1, round(0.1e9 / max(float(np.median(np.diff(time_ns))), 1.0))) if len(time_ns) > 20 else 1
    time_ns, rpy_rad = time_ns[::every], rpy_rad[::every]
    if len(time_ns) < 10 or len(imu_time_ns) < 10:
        return None
    steps_s = np.diff(time_ns)[:, None] * 1e-9
    between, gyros = integrator(imu_time_ns, omega_p_radps, int(time_ns[0])), []
    for lag in np.arange(-LAGS_S, LAGS_S + 0.5 * LAG_STEP_S, LAG_STEP_S):
        moved = time_ns + round(float(lag) * 1e9)
        inside = (moved[:-1] >= imu_time_ns[0]) & (moved[1:] <= imu_time_ns[-1])
        gyros.append((float(lag), inside, (between(moved) / steps_s)[inside]))
    by_frame = {}
    for frame in FRAMES:
        attitude = platform_attitude(from_angles(*rpy_rad.T), frame, np.zeros(3), 0.0)
        rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / steps_s
        # A quick jump is a wrap or a reset of the filter, not a turn.
        size = np.linalg.norm(rate, axis=1)
        calm = size < 8.0 * max(float(np.percentile(size, 90)), 1e-9)
        by_frame[frame] = max(
            (_compare(rate, calm, *gyro) for gyro in gyros), key=lambda one: one.correlation
        )
    frame = max(by_frame, key=lambda one: by_frame[one].correlation)
    other = by_frame["enu_flu" if frame == "ned_frd" else "ned_frd"]
    return replace(by_frame[frame], frame=frame, other=other.correlation)


def _compare(rate: Floats, calm: Flags, lag_s: float, inside: Flags, gyro: Floats) -> AttitudeMatch:
    """The attitude's calm rate against the gyros' at an offset, at the quarter turn that fits roll and pitch best."""
    none = AttitudeMatch("", -1.0, -1.0, np.nan, lag_s, -1.0)
    if len(gyro) < 8:
        return none
    a, b = (x - x.mean(axis=0) for x in (rate[inside & calm], gyro[calm[inside]]))
    # By the sums alone: of squares by axis, and of the products of the attitude's axes with the gyros'.
    of_rate, of_gyros, both = (a * a).sum(axis=0), (b * b).sum(axis=0), a.T @ b
    along, across = float(both[0, 0] + both[1, 1]), float(both[0, 1] - both[1, 0])
    level = np.hypot(along, across) / max(np.sqrt(float(of_rate[:2].sum() * of_gyros[:2].sum())), 1e-12)
    angle = np.rad2deg(np.arctan2(across, along))
    quarters = round(angle / 90.0)
    if level < LEVEL or abs(angle - 90.0 * quarters) > OFF_QUARTER_DEG:
        quarters = 0
    turn = TURNS_BY_QUARTERS[quarters % 4]
    of_rate, products = turn**2 @ of_rate, np.diagonal(turn @ both)
    scale = float(of_gyros.sum())
    total = np.sqrt(float(of_rate.sum()) * scale)
    if not total > 0.0:
        return none
    each = products / np.maximum(np.sqrt(of_rate * of_gyros), 1e-12)
    return AttitudeMatch(
        "", float(products.sum()) / total, -1.0, float(products.sum()) / scale, lag_s, float(each.min()),
        quarters % 4 if quarters % 4 != 3 else -1, float(level),
    )  # fmt: skip
