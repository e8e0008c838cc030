"""A stream of a first case against the IMU: what brings its clock to the IMU's, and whose turns are the better ones."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.attitude_fit import GyroErrors, gyro_errors
from bottomlock.recordings.rig_fit import Recorded
from bottomlock.recordings.rig_search import search_offset
from bottomlock.recordings.streams import Floats, Integers
from bottomlock.replay.init.attitude_part import AttitudePart
from bottomlock.replay.init.dvl_part import ENOUGH_PINGS, DvlPart
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import NOTHING, Guess
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.read_tables import OMEGA_SI, rate_unit

ENOUGH = 0.3
"""Streams that overlap by this fraction of the shorter one are taken to share a clock."""
LEAST_S = 60.0
"""Least overlap of two recordings that the motion brings together."""
Span = tuple[int, int]


def clock_offset(found: Found, imu: ImuPart, dvl: DvlPart) -> Guess:
    """The offset of a stream's clock: that of the IMU, of the DVL, or unknown."""
    assert found.times.time_ns is not None  # chosen so
    ours, theirs = _span(imu.time_ns), _span(found.times.time_ns)
    if _overlap(ours, theirs) > ENOUGH:
        return NOTHING
    if dvl.offset.value and _overlap((dvl.first_ns, dvl.last_ns), theirs) > ENOUGH:
        return Guess(dvl.offset.value, "it shares the DVL's clock", known=dvl.offset.known)
    why = "its clock has nothing in common with the IMU's: both are taken to begin together"
    return Guess((ours[0] - theirs[0]) * 1e-9, why, known=False)


def dvl_offset(dvl: DvlPart, imu: ImuPart) -> Guess:
    """The offset of a DVL's clock to the IMU's: none where they run together, else by the motion."""
    ours, theirs = _span(imu.time_ns), (dvl.first_ns, dvl.last_ns)
    if _overlap(ours, theirs) > ENOUGH:
        return NOTHING
    starts_s = (ours[0] - theirs[0]) * 1e-9
    imu_s, dvl_s = ((last - first) * 1e-9 for first, last in (ours, theirs))
    least_s = min(LEAST_S, 0.5 * min(imu_s, dvl_s))
    if len(dvl.time_ns) > ENOUGH_PINGS:
        begun = Recorded(imu.inertial, dvl.time_ns + round(starts_s * 1e9), dvl.velocity_p_mps)
        found = search_offset(begun, least_s - dvl_s, imu_s - least_s)
        if found is not None and found.clear:
            return Guess(
                starts_s + found.offset_s,
                f"the DVL's velocity follows the IMU's best there, {found.gain:.1f} times better than at other offsets "
                f"(next best {found.second:.1f})",
            )
    return Guess(
        starts_s,
        "the clocks have nothing in common, and the motion does not tell the offset: both files are taken to begin "
        "together",
        known=False,
    )


def _span(time_ns: Integers) -> Span:
    return int(time_ns[0]), int(time_ns[-1])


def _overlap(a: Span, b: Span) -> float:
    """Part of the shorter one that both have."""
    shorter = max(min(a[1] - a[0], b[1] - b[0]), 1)
    return (min(a[1], b[1]) - max(a[0], b[0])) / shorter


SURE = 0.7
"""Correlation of the turns from which their scale tells the unit."""
EARTH_RADPS = 7.292115e-5
POOR_RAD_RTS = 5e-4
"""Noise of gyros (1.7 deg/√h) from which the attitude's own turns are the better ones over seconds."""
LONGEST_STEP_S = 0.5
"""An attitude that is recorded less often does not resolve the turns of a small vehicle, and is not interpolated."""
RESOLVED = 2.0
"""Sigmas of its square by which it has to be larger."""


@dataclass(frozen=True, eq=False)
class Rates:
    """Rates of turn of the vehicle as known best.

    Attributes:
        gyros: the gyros against the attitude; None without one.
        omega_p_radps: (n, 3) at the IMU's times.
        of_attitude: whether they are those of the attitude, as the gyros are poor.
    """

    gyros: GyroErrors | None
    omega_p_radps: Floats
    of_attitude: bool = False


def unit_by_attitude(imu: ImuPart, attitude: AttitudePart | None) -> Guess | None:
    """Unit of the gyros by the slope of their turns over those of a recorded attitude; None where it does not tell."""
    match = None if attitude is None or imu.increments else attitude.match
    told = None if match is None or not match.clear else rate_unit(match.scale, imu.omega.value)
    if match is None or told is None or match.alike < SURE:
        return None
    unit, slope = told
    other = "deg/s" if unit == "rad/s" else "rad/s"
    return Guess(
        unit,
        f"in a second the gyros turn {slope:.2f} times as far as the recorded attitude "
        f"({slope * OMEGA_SI[other] / OMEGA_SI[unit]:.2g} in {other}), correlation {match.alike:.2f}",
    )


def turns(
    imu: ImuPart, attitude: AttitudePart | None, interval_s: float, latitude_rad: float = float("nan")
) -> Rates:
    """Rates of turn: of the gyros less their offset, or of the attitude where the gyros are poor.

    Args:
        imu, attitude: as guessed.
        interval_s: between pings.
        latitude_rad: for the Earth's rate, which is in the gyros; NaN where it is not known.
    """
    plain = Rates(None, imu.omega_p_radps)
    if attitude is None or attitude.match is None or not attitude.match.clear:
        return plain
    platform, omega = attitude.platform(), imu.omega_p_radps
    if np.isfinite(latitude_rad) and len(platform.time_ns):
        earth = EARTH_RADPS * np.array([np.cos(latitude_rad), 0.0, -np.sin(latitude_rad)])
        nearest = np.clip(np.searchsorted(platform.time_ns, imu.time_ns), 0, len(platform.time_ns) - 1)
        omega = omega - platform.attitude.inv().apply(earth)[nearest]
    gyros = gyro_errors(replace(imu.inertial, omega_p_radps=omega), platform, interval_s)
    if gyros is None:
        return plain
    if gyros.noise is not None and gyros.noise.square - RESOLVED * gyros.noise.sd > POOR_RAD_RTS**2:
        known = platform.covers(imu.time_ns, LONGEST_STEP_S)
        if known.any():
            rates = _rates(imu, platform.at(imu.time_ns))
            known &= np.isfinite(rates).all(axis=1)
            omega = np.where(known[:, None], rates, imu.omega_p_radps - gyros.offset_radps)
            return Rates(gyros, omega, of_attitude=True)
    return Rates(gyros, imu.omega_p_radps - gyros.offset_radps)


def _rates(imu: ImuPart, attitude: Rotation) -> Floats:
    """(n, 3) rates whose trapezoidal integral is the attitude's, to second order."""
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / (np.diff(imu.time_ns) * 1e-9)[:, None]
    return np.vstack([turned[:1], 0.5 * (turned[1:] + turned[:-1]), turned[-1:]])
