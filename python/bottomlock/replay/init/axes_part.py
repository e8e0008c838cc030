"""Axes, turns and velocity of IMU, attitude sensor and DVL against one another: quarter turns, handedness, yaw."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.recordings.rig_fit import LOOSE, Recorded, fit
from bottomlock.recordings.streams import Floats, Inertial
from bottomlock.replay.init.dvl_part import DvlPart
from bottomlock.replay.init.guess import Guess
from bottomlock.replay.init.imu_part import OMEGA_SI, ImuPart
from bottomlock.replay.init.other_parts import AttitudePart
from bottomlock.replay.init.positions import PositionPart
from bottomlock.replay.motion.gyros import LONGEST_STEP_S, GyroMatch, attitude_at, match_gyros, slope
from bottomlock.replay.motion.mounting_yaw import MountingYaw, yaw_by_accelerations, yaw_by_positions

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
    inertial = Inertial(imu.time_ns, imu.force_s_mps2 @ P.T, omega)
    return Recorded(inertial, dvl.time_ns + round(dvl.offset_s * 1e9), dvl.velocity_p_mps)


CLEAR = 40.0
"""Difference of two costs from which axes are told apart: a likelihood ratio beyond any doubt."""
QUARTER_SD_RAD = np.deg2rad(20.0)
"""1 sigma of a yaw from which it does not tell quarter turns apart."""
STIFF = {"rotation": 0.2, "gyro_bias": 1e-3, "scale": 1e-3}
"""1 sigma of a fit with poor accelerometers, whose noise would be taken for a scale: rad, rad/s, 1."""
STIFF_SCALE = {"scale": 0.01}
"""That of a DVL, where a calm dive does not tell it from the accelerometers' noise."""
SIGMAS = 5.0
OFF_QUARTER_RAD = np.deg2rad(10.0)
LEAST_YAW_RAD = np.deg2rad(5.0)
"""A smaller mounting yaw is stated and not applied: the heading may be off as much."""
TRACKED = 0.8
"""Agreement of a track with positions from which it tells a direction."""
USUAL_STEPS = 3.0
"""Steps of a slow attitude, as many times its usual one, over which a track turns evenly enough."""
FELT = 0.3
"""That of velocity and accelerations: below it errors of the attitude under acceleration may decide the yaw."""


def _yaw(quarters: float) -> Floats:
    return np.asarray(Rotation.from_euler("Z", 90.0 * quarters, degrees=True).as_matrix()).round(12) + 0.0


def set_axes(dvl: DvlPart, imu: ImuPart, turned: Turns | None, track: MountingYaw | None) -> ImuPart:
    """Axes about the vertical, by which the velocity follows the inertial readings, and what a fit of both finds.

    Args:
        dvl, imu: as guessed.
        turned: rates of turn by an attitude that confirms the axes of the gyros; None without one.
        track: yaw of the velocity by recorded positions; None where they do not tell it.
    """
    if turned is None:
        imu, omega = _of_all_choices(dvl, imu), None
        dvl.match = fit(recorded(imu, dvl), prior=LOOSE)
    else:
        before = imu.axes
        imu = _of_yaws(dvl, imu, yaw_by_accelerations(recorded(imu, dvl, turned.omega_p_radps)), track)
        omega = turned.omega_p_radps @ before @ imu.axes.T
        dvl.match = fit(recorded(imu, dvl, omega), prior=LOOSE | (STIFF if turned.of_attitude else {}))
    if dvl.match is not None and not dvl.match.plausible:
        stiff = fit(recorded(imu, dvl, omega), prior=LOOSE | STIFF_SCALE)
        dvl.match = stiff if stiff is not None and stiff.plausible else dvl.match
    if dvl.match is None:
        dvl.questions.append("too few pings overlap the IMU's readings: clock and axes could not be compared")
    _refine_clock(dvl)
    return imu


def _of_yaws(dvl: DvlPart, imu: ImuPart, felt: MountingYaw | None, track: MountingYaw | None) -> ImuPart:
    """The IMU turned to a DVL's vehicle axes, or the DVL mounted at a yaw, as accelerations and track show.

    A velocity in columns is usually in the vehicle's axes, so a quarter turn is that of the IMU; beams are those of an
    instrument, whose file has a mounting. Any other angle is the DVL's.
    """
    felt = _telling(felt, FELT)
    words = []
    if felt is not None:
        words.append(
            f"by its accelerations the DVL's velocity is turned by {felt.words} against IMU and attitude"
        )
    if track is not None:
        words.append(_by_track(track))
    dvl.mounting_why = "; ".join(words)
    if felt is not None and track is not None:
        apart = abs(float(np.angle(np.exp(1j * (track.yaw_rad - felt.yaw_rad)))))
        if apart > 3.0 * np.hypot(felt.sd_rad, track.sd_rad):
            dvl.questions.append(
                f"is the heading right? Both disagree: yaw_offset_deg of [attitude] may be {np.rad2deg(apart):.0f} off"
            )
            track = None
    best = track or felt
    if best is None:
        return imu
    quarters = round(best.yaw_rad / (0.5 * np.pi))
    off = abs(best.yaw_rad - 0.5 * np.pi * quarters)
    of_quarter = off < max(2.0 * best.sd_rad, OFF_QUARTER_RAD)
    if of_quarter and quarters and dvl.recording is None:
        dvl.mounting_why += f", so IMU and attitude are turned by {-90 * quarters:+d} deg to it"
        return imu.with_axes(_yaw(-quarters) @ imu.axes, f"{imu.axes_why}; see [dvl]", known=True)
    if best is track:
        _mounted(dvl, best)
    elif of_quarter and quarters:
        dvl.turned(0.5 * np.pi * quarters)
    elif not of_quarter:
        dvl.questions.append(
            f"how is the DVL mounted? mounting_yaw_deg of its file may be {np.rad2deg(best.yaw_rad):.0f}"
        )
    return imu.with_axes(imu.axes, imu.axes_why, known=imu.axes_known or of_quarter)


def set_yaw_by_track(dvl: DvlPart, track: MountingYaw | None) -> None:
    """Mounting yaw of a DVL on a vehicle without inertial readings, by its track against positions."""
    if track is None:
        dvl.questions.append("no inertial readings: are clock and axes of the DVL those of the attitude?")
        return
    dvl.mounting_why = _by_track(track)
    _mounted(dvl, track)


def _by_track(track: MountingYaw) -> str:
    return f"by its track against the recorded positions by {track.words}, an error of the heading included"


def _mounted(dvl: DvlPart, track: MountingYaw) -> None:
    """The DVL turned by the yaw of its track, where that is beyond doubt."""
    if abs(track.yaw_rad) > max(SIGMAS * track.sd_rad, LEAST_YAW_RAD):
        dvl.turned(track.yaw_rad)


def telling_track(track: MountingYaw | None) -> MountingYaw | None:
    """The yaw of a track, where it tells a direction."""
    return _telling(track, TRACKED)


def _telling(yaw: MountingYaw | None, agreement: float) -> MountingYaw | None:
    """The yaw, where its agreement and its sigma tell quarter turns apart."""
    tells = yaw is not None and yaw.agreement > agreement and yaw.sd_rad < QUARTER_SD_RAD
    return yaw if tells else None


def _of_all_choices(dvl: DvlPart, imu: ImuPart) -> ImuPart:
    """Axes about the vertical and handedness of an IMU without attitude, by which choice lets the velocity follow."""
    mirror = np.diag([1.0, -1.0, 1.0])
    choices = {"as named": np.eye(3)} | {f"turned by {90 * k} deg": _yaw(k) for k in (1, 2, 3)}
    if not imu.handed:
        choices |= {f"mirrored {k}": _yaw(k) @ mirror for k in range(4)}
    prior = LOOSE | {"rotation": 0.2}
    fits = {name: fit(recorded(imu, dvl, axes=Q @ imu.axes), prior=prior) for name, Q in choices.items()}
    known = {name: one for name, one in fits.items() if one is not None}
    if not known:
        return imu
    sigma = min(one.sigma_mps for one in known.values())
    costs = {}
    for name in known:
        one = fit(recorded(imu, dvl, axes=choices[name] @ imu.axes), prior=prior, sigma_mps=sigma)
        costs[name] = np.inf if one is None else one.cost
    order = sorted(costs, key=lambda name: costs[name])
    best = order[0]
    if (
        best != "as named"
        and costs["as named"] - costs[best] > CLEAR
        and (len(order) < 2 or costs[order[1]] - costs[best] > CLEAR)
    ):
        Q = choices[best]
        odds = (
            f"the DVL's velocity follows the IMU with these axes (cost {costs[best]:.0f}, as named "
            f"{costs['as named']:.0f})"
        )
        imu = imu.with_axes(Q @ imu.axes, f"{imu.axes_why}; {odds}", known=True)
    elif best == "as named" and len(order) > 1 and costs[order[1]] - costs[best] > CLEAR:
        odds = f"the DVL's velocity follows the IMU (cost {costs[best]:.0f}, next best axes {costs[order[1]]:.0f})"
        imu = imu.with_axes(imu.axes, f"{imu.axes_why}; {odds}", known=True)
    return imu


def track_yaw(
    dvl: DvlPart, attitude: AttitudePart | None, positions: PositionPart | None
) -> MountingYaw | None:
    """Yaw of the velocity by its track against recorded positions; None where these do not tell.

    The frame of the attitude need not be known: in a wrong one track and positions do not agree.
    """
    if attitude is None or positions is None or len(dvl.time_ns) < 2:
        return None
    times = dvl.time_ns + round(dvl.offset_s * 1e9)
    own_ns, platform = attitude.platform()
    usual_s = float(np.median(np.diff(own_ns))) * 1e-9
    own = attitude_at(own_ns, platform, times, max(LONGEST_STEP_S, USUAL_STEPS * usual_s))
    if own is None:
        return None
    known = own[1]
    return yaw_by_positions(
        times[known], dvl.velocity_p_mps[known], own[0][known], positions.time_ns, positions.north_east_m
    )


def _refine_clock(dvl: DvlPart) -> None:
    """Takes over a clock offset that the motion shows beyond doubt."""
    match = dvl.match
    if match is None or not match.plausible:
        if match is not None:
            dvl.questions.append(
                "the velocity does not follow the IMU: are both of the same dive, and which axes have they?"
            )
        return
    clock, sd = float(match.part("clock")[0]), float(match.part_sd("clock")[0])
    if abs(clock) > max(6.0 * sd, 0.03):
        dvl.offset_s += clock
        words = f"the DVL's velocity follows the IMU best when moved by {clock:+.3f} ± {sd:.2g} s"
        dvl.offset_why = f"{dvl.offset_why}; {words}" if dvl.offset_why else words
