"""The attitude of a first case: unit, frames and clock by its own rate against the gyros, or turns in their place."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.arrays import rising
from bottomlock.errors import DataError
from bottomlock.recordings.attitude_fit import APART, DECIDES, FRAMES, AttitudeFit, fit_attitude
from bottomlock.recordings.attitude_motion import inertial_readings
from bottomlock.recordings.axes import from_angles, platform_attitude
from bottomlock.recordings.streams import Attitudes, Floats
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import NOTHING, Guess, angle_unit
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.read_tables import NEAR

OFFSET_S = 0.1
"""Smaller clock offsets of an attitude are not set."""


@dataclass(frozen=True, eq=False)
class AttitudePart:
    """An attitude as guessed: its table has angles, or (`rpy_rad` written again) quaternions."""

    found: Found
    rpy_rad: Floats
    unit: Guess
    match: AttitudeFit | None
    offset: Guess
    declination: Guess = NOTHING

    @property
    def quarters(self) -> int:
        """Quarter turns from the sensor's axes to the platform's."""
        return self.match.quarters if self.match is not None and self.match.clear else 0

    def platform(self) -> Attitudes:
        """Attitudes of the platform, on the IMU's clock."""
        of = _sensed(self.found, self.rpy_rad, self.offset)
        mounting = np.array([0.0, 0.0, 0.5 * np.pi * self.quarters])
        return replace(
            of, attitude=platform_attitude(of.attitude, self.frame.value, mounting, self.declination.value)
        )

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


def _sensed(found: Found, rpy_rad: Floats, offset: Guess) -> Attitudes:
    """Attitudes of the sensor, of angles (n, 3) in frames as for forward, right and down, on the IMU's clock."""
    times = found.times.time_ns
    assert times is not None  # guessed from them
    good = np.isfinite(rpy_rad).all(axis=1) & rising(times)
    return Attitudes(times[good] + round(offset.value * 1e9), from_angles(*rpy_rad[good].T))


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
    down = np.array([0.0, 0.0, 1.0])
    if imu is not None and not imu.made and found.times.time_ns is not None:
        matches = [fit_attitude(imu.inertial, _sensed(found, one, offset), search=True) for one in rpy]
        fits = [-1.0 if one is None else one.correlation for one in matches]
        best = int(np.argmax(fits))
        if fits[best] > DECIDES and fits[best] > fits[1 - best] + APART:
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
    if found.times.time_ns is None:
        return None
    rpy, unit = angles_of(found, imu, offset)
    match = fit_attitude(imu.inertial, _sensed(found, rpy, offset), search=True)
    if match is not None and match.clear:
        if not unit.known and "q0" not in found.columns:
            if match.scale < 0.1:
                unit = Guess(
                    "deg", f"in radians its turns would be {1.0 / match.scale:.0f} times those of the gyros"
                )
                rpy = np.deg2rad(rpy)
            elif 1.0 / NEAR < match.scale < NEAR:
                unit = Guess(unit.value, f"{unit.why}, and the gyros turn {match.scale:.2f} times as far")
        if abs(match.clock_s) > OFFSET_S and found.times is not imu.found.times:
            why = f"its turn rates fit the gyros' best when moved by {match.clock_s:+.2f} s"
            offset = Guess(offset.value + match.clock_s, why)
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
