"""Attitude and depth of a first case."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.recordings.axes import from_angles, platform_attitude
from bottomlock.replay.init.attitude import AttitudeMatch, match_attitude
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import BAR, Guess, angle_unit, pressure_unit
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.statistics.robust import sd_about_zero

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
ENOUGH = 0.3
"""Streams that overlap by this fraction of the shorter one are taken to share a clock."""
OFFSET_S = 0.1
"""Smaller clock offsets of an attitude are not set."""


@dataclass(frozen=True)
class Offset:
    """A stream's clock against the IMU's, and why; `known` is false for a question."""

    seconds: float = 0.0
    why: str = ""
    known: bool = True


def clock_offset(time_ns: Integers, imu: ImuPart, dvl: DvlPart) -> Offset:
    """The offset of a stream's clock: that of the IMU, of the DVL, another time zone, or unknown."""
    ours, theirs = (int(imu.time_ns[0]), int(imu.time_ns[-1])), (int(time_ns[0]), int(time_ns[-1]))
    if _overlap(ours, theirs) > ENOUGH:
        return Offset()
    if dvl.offset_s and _overlap((dvl.first_ns, dvl.last_ns), theirs) > ENOUGH:
        return Offset(dvl.offset_s, "it shares the DVL's clock", known=dvl.offset_known)
    for hours in (k / 2.0 for k in range(-28, 29)):
        shift = round(hours * 3600e9)
        if hours and _overlap(ours, (theirs[0] + shift, theirs[1] + shift)) > 0.6:
            return Offset(
                shift * 1e-9, f"the files overlap when its clock is moved by {hours:g} h, a time zone"
            )
    return Offset(
        (ours[0] - theirs[0]) * 1e-9, "its clock has nothing in common with the IMU's: both are taken to begin "
        "together",
        known=False,
    )  # fmt: skip


def _overlap(a: tuple[int, int], b: tuple[int, int]) -> float:
    shorter = max(min(a[1] - a[0], b[1] - b[0]), 1)
    return (min(a[1], b[1]) - max(a[0], b[0])) / shorter


@dataclass(eq=False)
class AttitudePart:
    """An attitude as guessed: its table has angles, or (`rpy_rad` written again) quaternions."""

    found: Found
    rpy_rad: Floats
    unit: Guess
    match: AttitudeMatch | None
    offset: Offset
    declination_rad: float = 0.0
    declination_why: str = ""

    @property
    def quarters(self) -> int:
        """Quarter turns from the sensor's axes to the platform's."""
        return self.match.quarters if self.match is not None and self.match.clear else 0

    def platform(self) -> tuple[Integers, Rotation]:
        """Rising times on the IMU's clock, and attitudes of the platform."""
        times = self.found.times.time_ns
        assert times is not None  # guessed from them
        before = np.concatenate([[np.iinfo(np.int64).min], np.maximum.accumulate(times)[:-1]])
        good = np.isfinite(self.rpy_rad).all(axis=1) & (times > before)
        mounting = np.array([0.0, 0.0, 0.5 * np.pi * self.quarters])
        attitude = platform_attitude(
            from_angles(*self.rpy_rad[good].T), self.frame.value, mounting, self.declination_rad
        )
        return times[good] + round(self.offset.seconds * 1e9), attitude

    @property
    def frame(self) -> Guess:
        """Frames of the angles."""
        if self.match is None:
            return Guess("ned_frd", "too few rows overlap the gyros", known=False)
        if not self.match.clear:
            return Guess(
                "ned_frd", f"the gyros do not decide (correlation {self.match.correlation:.2f} and "
                f"{self.match.other:.2f})",
                known=False,
            )  # fmt: skip
        return Guess(
            self.match.frame,
            f"its rates follow the gyros with a correlation of {self.match.correlation:.2f}, "
            f"{self.match.other:.2f} in the other "
            "frames",
        )


def guess_attitude(found: Found, imu: ImuPart, dvl: DvlPart) -> AttitudePart | None:
    """Unit, frames and clock of an attitude; None where it has no times."""
    times = found.times.time_ns
    if times is None:
        return None
    if "q0" in found.columns:
        q = found.values("q0", "q1", "q2", "q3")
        size = np.linalg.norm(q, axis=1)
        good = np.isfinite(size) & (size > 0.5)
        rpy = np.full((len(q), 3), np.nan)
        rpy[good] = Rotation.from_quat(np.roll(q[good], -1, axis=1)).as_euler("ZYX")[:, ::-1]
        unit = Guess("rad", "")
    else:
        angles = found.values("roll", "pitch", "yaw")
        unit = angle_unit(angles, found.units.get("yaw", ""))
        rpy = angles * (np.pi / 180.0 if unit.value == "deg" else 1.0)
    offset = clock_offset(times, imu, dvl)
    match = match_attitude(times + round(offset.seconds * 1e9), rpy, imu.time_ns, imu.omega_p_radps)
    part = AttitudePart(found, rpy, unit, match, offset)
    if match is not None and match.clear:
        slope = match.slope
        if not unit.known and slope < 0.1 and "q0" not in found.columns:
            part.unit = Guess(
                "deg", f"in radians its rates would be {1.0 / max(slope, 1e-9):.0f} times those of the gyros"
            )
            part.rpy_rad = np.deg2rad(rpy)
        if abs(match.offset_s) > OFFSET_S and found.times is not imu.found.times:
            moved = offset.seconds + match.offset_s
            part.offset = Offset(
                moved, f"its turn rates fit the gyros' best when moved by {match.offset_s:+.2f} s"
            )
    return part


@dataclass(frozen=True, eq=False)
class DepthPart:
    """A depth or pressure as guessed; `depth_m` (n,) in metres, positive down."""

    found: Found
    unit: Guess
    up: Guess | None
    offset_m: Guess | None
    sd_m: float
    offset: Offset
    depth_m: Floats


def guess_depth(found: Found, imu: ImuPart, dvl: DvlPart) -> DepthPart | None:
    """Unit and sign of a depth; None where it has no times."""
    times = found.times.time_ns
    if times is None:
        return None
    values = found.values(*found.columns)[:, 0]
    up = shift = None
    if found.kind == "pressure":
        unit = pressure_unit(values, found.units.get("pressure", ""))
        metres = values * BAR[unit.value] * 1e5 / (1025.0 * 9.80665)
        if np.nanmin(values) * BAR[unit.value] > 0.8:
            shift = Guess(
                "-10.08", "the pressure is absolute: that of the air, 1013 mbar, is 10.08 m of sea water"
            )
            metres = metres - 10.08
    else:
        hint = found.units.get("depth", "")
        unit = Guess(
            "cm" if hint == "cm" else "m",
            "the column's name says so" if hint else "metres are usual",
            known=bool(hint),
        )
        metres = values * (0.01 if unit.value == "cm" else 1.0)
        if np.nanmedian(metres) < -0.3:
            up = Guess("true", f"its median is {np.nanmedian(values):.3g}, below the surface: positive up")
            metres = -metres
    good = metres[np.isfinite(metres)]
    second = good[2:] - 2.0 * good[1:-1] + good[:-2]
    sd = float(sd_about_zero(second)) / np.sqrt(6.0) if len(second) else 0.0
    return DepthPart(
        found, unit, up, shift, max(0.02, round(2.0 * sd, 3)), clock_offset(times, imu, dvl), metres
    )
