"""The streams of a first case against one another: turns of the vehicle, inertial readings with the DVL's velocity."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.streams import Floats
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.guess import Guess
from bottomlock.replay.init.imu_part import OMEGA_SI, ImuPart
from bottomlock.replay.init.other_parts import AttitudePart
from bottomlock.replay.motion.fit import Recorded
from bottomlock.replay.motion.gyros import GyroMatch, attitude_at, match_gyros, slope

EARTH_RADPS = 7.292115e-5
SURE = 0.7
"""Correlation of one-second turns from which their slope tells the unit of the gyros."""
NEAR = 2.0
"""A unit is told by a slope within this factor."""
POOR_RAD_RTS = 5e-4
"""Noise of gyros (1.7 deg/√h) from which the attitude's own turns are the better ones over seconds."""


@dataclass(frozen=True, eq=False)
class Turns:
    """Rates of turn of the vehicle as known best.

    Attributes:
        gyros: the gyros against the attitude; None without one.
        omega_p_radps: (n, 3) at the IMU's times.
        of_attitude: whether they are those of the attitude, as the gyros are poor.
    """

    gyros: GyroMatch | None
    omega_p_radps: Floats
    of_attitude: bool = False


def unit_by_attitude(imu: ImuPart, attitude: AttitudePart | None) -> Guess | None:
    """Unit of the gyros by the slope of their turns over those of a recorded attitude; None where it does not tell."""
    if attitude is None or imu.increments or attitude.match is None or not attitude.match.clear:
        return None
    own = OMEGA_SI[imu.omega.value]
    found = slope(imu.time_ns, imu.omega_p_radps, *attitude.platform())
    if found is None or found[1] < SURE or not found[0] > 0.0:
        return None
    slopes = {unit: found[0] * factor / own for unit, factor in OMEGA_SI.items()}
    best = min(slopes, key=lambda unit: abs(np.log(slopes[unit])))
    if not 1.0 / NEAR < slopes[best] < NEAR:
        return None
    other = "deg/s" if best == "rad/s" else "rad/s"
    return Guess(
        best,
        f"in a second the gyros turn {slopes[best]:.2f} times as far as the recorded attitude ({slopes[other]:.2g} in "
        f"{other}), correlation {found[1]:.2f}",
    )


def turns(
    imu: ImuPart, attitude: AttitudePart | None, interval_s: float, latitude_rad: float = float("nan")
) -> Turns:
    """Rates of turn: of the gyros less their offset, or of the attitude where the gyros are poor.

    Args:
        imu, attitude: as guessed.
        interval_s: between pings.
        latitude_rad: for the Earth's rate, which is in the gyros; NaN where it is not known.
    """
    plain = Turns(None, imu.omega_p_radps)
    if attitude is None or attitude.match is None or not attitude.match.clear:
        return plain
    times, platform = attitude.platform()
    omega = imu.omega_p_radps
    if np.isfinite(latitude_rad) and len(times):
        earth = EARTH_RADPS * np.array([np.cos(latitude_rad), 0.0, -np.sin(latitude_rad)])
        nearest = np.clip(np.searchsorted(times, imu.time_ns), 0, len(times) - 1)
        omega = omega - platform.inv().apply(earth)[nearest]
    gyros = match_gyros(imu.time_ns, omega, times, platform, interval_s)
    if gyros is None:
        return plain
    if gyros.noise_rad_rts > POOR_RAD_RTS:
        found = attitude_at(times, platform, imu.time_ns)
        if found is not None:
            rates = _rates(imu, found[0])
            known = found[1] & np.isfinite(rates).all(axis=1)
            omega = np.where(known[:, None], rates, imu.omega_p_radps - gyros.offset_radps)
            return Turns(gyros, omega, of_attitude=True)
    return Turns(gyros, imu.omega_p_radps - gyros.offset_radps)


def _rates(imu: ImuPart, attitude: Rotation) -> Floats:
    """(n, 3) rates whose trapezoidal integral is the attitude's, to second order."""
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / (np.diff(imu.time_ns) * 1e-9)[:, None]
    return np.vstack([turned[:1], 0.5 * (turned[1:] + turned[:-1]), turned[-1:]])


def recorded(
    imu: ImuPart, dvl: DvlPart, omega_p_radps: Floats | None = None, axes: Floats | None = None
) -> Recorded:
    """Inertial readings, with other rates or axes than the IMU's own, and the velocity on their clock."""
    P = imu.axes if axes is None else axes
    omega = imu.omega_s_radps @ P.T if omega_p_radps is None else omega_p_radps
    return Recorded(
        imu.time_ns,
        imu.force_s_mps2 @ P.T,
        omega,
        dvl.time_ns + round(dvl.offset_s * 1e9),
        dvl.velocity_p_mps,
    )
