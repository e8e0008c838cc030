"""The streams of a first case, and what they say of one another: axes, turns, velocity, handedness, yaw, clock."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError
from bottomlock.recordings.attitude_fit import GyroErrors
from bottomlock.recordings.axes import to_angles
from bottomlock.recordings.noise_growth import Walk
from bottomlock.recordings.pings import PingNoise, ping_noise
from bottomlock.recordings.rig_fit import LOOSE, Match, Recorded, fit
from bottomlock.recordings.rig_search import MIRROR, fit_anyhow
from bottomlock.recordings.streams import Floats, Inertial
from bottomlock.recordings.track_fit import TrackFit, fit_track
from bottomlock.replay.init.against_imu import LONGEST_STEP_S, Rates, clock_offset, turns
from bottomlock.replay.init.attitude_part import AttitudePart, guess_attitude
from bottomlock.replay.init.depth_part import DepthPart
from bottomlock.replay.init.dvl_part import DvlPart, with_noise
from bottomlock.replay.init.found import Found
from bottomlock.replay.init.guess import Guess
from bottomlock.replay.init.imu_part import ImuPart
from bottomlock.replay.init.positions import PositionPart
from bottomlock.replay.vehicle_motion import vehicle_motion


@dataclass(frozen=True, eq=False)
class Parts:
    """The streams that a case uses, and what they say of one another.

    Attributes:
        imu, dvl, attitude, depth, gps, reference: as guessed, None where absent.
        unused: streams of the files that the case does not name.
        gyros: the gyros against the attitude; None without one.
        pings: the velocity against the accelerometers; None with too few pings.
    """

    imu: ImuPart
    dvl: DvlPart
    attitude: AttitudePart | None
    depth: DepthPart | None
    gps: PositionPart | None
    reference: PositionPart | None
    unused: Sequence[Found] = ()
    gyros: GyroErrors | None = None
    pings: PingNoise | None = None

    @property
    def latitude_rad(self) -> float:
        """Latitude of the first recorded position; NaN without one on the Earth."""
        known = [one.latitude_rad for one in (self.reference, self.gps) if one is not None]
        return next((latitude for latitude in known if isfinite(latitude)), float("nan"))

    @property
    def attitude_of_reference(self) -> bool:
        """Whether the attitude is that of the reference, which must not aid what it judges.

        In a logger's table of all sensors it is the sensor's own.
        """
        if self.attitude is None or self.reference is None:
            return False
        table = self.reference.found.table
        return self.attitude.found.table is table and (self.imu.made or self.imu.found.table is not table)


def recorded(imu: ImuPart, dvl: DvlPart, omega_p_radps: Floats | None = None) -> Recorded:
    """Inertial readings, with other rates than the IMU's own, and the velocity on their clock."""
    omega = imu.omega_p_radps if omega_p_radps is None else omega_p_radps
    return Recorded(Inertial(imu.time_ns, imu.force_p_mps2, omega), dvl.on_imu_ns, dvl.velocity_p_mps)


QUARTER_SD_RAD = np.deg2rad(20.0)
"""1 sigma of a yaw from which it does not tell quarter turns apart."""
STIFF = {"rotation": 0.2, "gyro_bias": 1e-3, "scale": 1e-3}
"""1 sigma of a fit with poor accelerometers, whose noise would be taken for a scale: rad, rad/s, 1."""
STIFF_SCALE = {"scale": 0.01}
"""That of a DVL, where a calm dive does not tell it from the accelerometers' noise."""
SIGMAS = 5.0
QUARTER_RAD = 0.5 * np.pi
OFF_QUARTER_RAD = np.deg2rad(10.0)
LEAST_YAW_RAD = np.deg2rad(5.0)
"""A smaller mounting yaw is stated and not applied: the heading may be off as much."""
TRACKED = 0.8
"""Agreement of a track with positions from which it tells a direction."""
USUAL_STEPS = 3.0
"""Steps of a slow attitude, as many times its usual one, over which a track turns evenly enough."""
FELT = 0.3
"""Part of the velocity that the inertial readings explain, from which they tell its axes: 0.98 on A-KIT and on dives of
tests/dive.py, below 0.07 on sections of St Pere, whose accelerometers are poor."""

LARGEST_SCALE = 0.5
"""A DVL whose velocity has to be scaled by more is not told by a fit: 0.32 on A-KIT, whose tilt is unknown."""


def _yaw(yaw_rad: float) -> Floats:
    return np.asarray(Rotation.from_euler("Z", yaw_rad).as_matrix()).round(12) + 0.0


CONFIRMED = 0.5
"""Correlation of the rates on every axis from which an attitude confirms the axes of the IMU."""


def by_attitude(parts: Parts) -> Parts:
    """The streams of a vehicle without inertial readings: noise of the DVL by its pings, its yaw by positions.

    Raises:
        DataError: for too few pings to tell how the vehicle moves, which takes the place of an IMU.
    """
    pings = noise_of_pings(parts.dvl)
    if pings is None:
        raise DataError(
            f"no file holds an IMU, and {len(parts.dvl.time_ns)} pings have a velocity by three beams or more: how "
            "the vehicle moves cannot be told",
            hint="name the table of the IMU",
        )
    dvl, attitude = with_noise(parts.dvl, pings), parts.attitude
    track = track_yaw(dvl, attitude, parts.reference)
    if track is None or attitude is None:
        why = "no inertial readings: clock and axes of the DVL are those of the attitude"
        return replace(parts, dvl=dvl.saying("axes", why))
    attitude, track = true_or_magnetic(attitude, track, None)
    dvl = _mounted(replace(dvl, mounting_why=_by_track(track)), track)
    return replace(parts, dvl=dvl, attitude=attitude)


def noise_of_pings(dvl: DvlPart) -> PingNoise | None:
    """Noise of a velocity by its changes alone, those of the vehicle left out; None for too few pings."""
    try:
        motion = vehicle_motion(dvl.time_ns, dvl.velocity_p_mps)
    except DataError:
        return None
    return PingNoise(motion.white_sd_mps, Walk(0.0, 0.0), motion.pings)


def by_motion(parts: Parts) -> Parts:
    """The streams with axes, clock and noise by comparing IMU, DVL, attitude and positions with one another."""
    interval_s = float(np.median(np.diff(parts.dvl.time_ns))) * 1e-9
    attitude = parts.attitude
    confirmed = attitude is not None and attitude.match is not None and attitude.match.least > CONFIRMED
    turned = turns(parts.imu, attitude, interval_s, parts.latitude_rad) if confirmed else None
    parts = _with_axes(parts, turned)
    imu, attitude = parts.imu, parts.attitude
    if attitude is not None:
        again = guess_attitude(attitude.found, imu, clock_offset(attitude.found, imu, parts.dvl))
        attitude = None if again is None else replace(again, declination=attitude.declination)
    rates = turns(imu, attitude, interval_s, parts.latitude_rad)
    pings = ping_noise(recorded(imu, parts.dvl, rates.omega_p_radps))
    if rates.of_attitude and rates.gyros is not None and pings is not None:
        # The force is integrated with the gyros' rotation by a filter, too, so that their part in its error counts.
        own = ping_noise(recorded(imu, parts.dvl, imu.omega_p_radps - rates.gyros.offset_radps))
        if own is not None and own.force.square > pings.force.square:
            pings = replace(own, velocity_sd_mps=pings.velocity_sd_mps)
    return replace(parts, attitude=attitude, gyros=rates.gyros, pings=pings, dvl=with_noise(parts.dvl, pings))


def _with_axes(parts: Parts, turned: Rates | None) -> Parts:
    """The streams in axes by which the velocity follows the inertial readings, and what a fit of both finds in them.

    Args:
        parts: as guessed.
        turned: rates of turn by an attitude that confirms the axes of the gyros; None without one.
    """
    dvl, attitude, before = parts.dvl, parts.attitude, parts.imu.axes
    omega = None if turned is None else turned.omega_p_radps
    left_handed = turned is None and not parts.imu.handed
    dvl, felt = _felt(dvl, recorded(parts.imu, dvl, omega), left_handed=left_handed)
    # Of the velocity in the axes that it was found to have.
    track = None if parts.attitude_of_reference else track_yaw(dvl, attitude, parts.reference)
    if track is not None and attitude is not None:
        attitude, track = true_or_magnetic(attitude, track, felt)
    of_vehicle = turned is None or dvl.recording is None
    dvl, imu = _placed(dvl, parts.imu, felt, track, of_vehicle=of_vehicle)
    omega = None if omega is None else omega @ before @ imu.axes.T
    prior = LOOSE | (STIFF if turned is not None and turned.of_attitude else {})
    match = fit(recorded(imu, dvl, omega), prior=prior)
    if match is not None and not match.plausible:
        stiff = fit(recorded(imu, dvl, omega), prior=LOOSE | STIFF_SCALE)
        match = stiff if stiff is not None and stiff.plausible else match
    return replace(parts, imu=imu, dvl=_matched(dvl, match), attitude=attitude)


def _felt(dvl: DvlPart, recorded: Recorded, *, left_handed: bool) -> tuple[DvlPart, Match | None]:
    """The DVL, and the fit in the axes that a search finds; of an IMU that may be left-handed, the better one.

    In left-handed axes of an IMU rates turn the other way. A velocity in left-handed axes gets its y axis reversed.
    """
    fits = [
        (hand, fit_anyhow(recorded.with_gyros(hand))) for hand in ((1.0, -1.0) if left_handed else (1.0,))
    ]
    telling = [(hand, one) for hand, one in fits if one is not None and one.explained > FELT]
    if not telling:
        return dvl, None
    hand, best = min(telling, key=lambda one: one[1].sigma_mps)
    if np.linalg.det(best.turned) * hand > 0.0:
        return dvl, best
    if hand < 0.0 or dvl.recording is not None:
        return dvl, None
    return dvl.mirrored(), replace(best, axes=best.axes @ MIRROR)


def _placed(
    dvl: DvlPart, imu: ImuPart, felt: Match | None, track: TrackFit | None, *, of_vehicle: bool
) -> tuple[DvlPart, ImuPart]:
    """The IMU turned to a DVL's vehicle axes, or the DVL mounted, as accelerations and track show.

    A velocity in columns is usually in the vehicle's axes, so a quarter turn is that of the IMU, as that of an IMU
    alone and a change of hand are; beams are those of an instrument, whose file has a mounting. Any other angle is the
    DVL's.

    Args:
        dvl, imu: as guessed.
        felt, track: where they tell anything.
        of_vehicle: whether a quarter turn is that of the IMU.
    """
    words = [] if felt is None else [_by_accelerations(felt)]
    words += [] if track is None else [_by_track(track)]
    why = "; ".join(words)
    if felt is not None and track is not None:
        apart = abs(float(np.angle(np.exp(1j * (track.angle_rad - _heading(felt.turned))))))
        if apart > 3.0 * np.hypot(felt.part_sd("rotation")[2], track.sd_rad):
            dvl = dvl.saying(
                "mounting_yaw_deg", f"both disagree: yaw_offset_deg of [attitude] may be {np.rad2deg(apart):.0f} off",
                "heading",
            )  # fmt: skip
            track = None
    by_track = track is not None and (felt is None or felt.turned[2, 2] > np.cos(OFF_QUARTER_RAD))
    if track is not None and by_track:
        turned, sd = _yaw(track.angle_rad), track.sd_rad
    elif felt is not None:
        turned, sd = felt.turned, float(felt.part_sd("rotation")[2])
    else:
        return replace(dvl, mounting_why=why), imu
    left_handed = bool(np.linalg.det(turned) < 0.0)
    quarters = round(_heading(turned) / QUARTER_RAD)
    stands = _yaw(QUARTER_RAD * quarters) @ (MIRROR if left_handed else np.eye(3))
    off = float(Rotation.from_matrix(turned @ stands.T).magnitude())
    of_quarter = off < max(2.0 * sd, OFF_QUARTER_RAD)
    if left_handed or (of_quarter and quarters and of_vehicle):
        why += f", so IMU and attitude are turned by {-90 * quarters:+d} deg to it"
        why += ", and left-handed" if left_handed else ""
        imu = imu.with_axes(stands.T @ imu.axes, f"{imu.axes_why}; see [dvl]", known=True)
        return replace(dvl, mounting_why=why), imu
    dvl = replace(dvl, mounting_why=why)
    if track is not None and by_track:
        dvl = _mounted(dvl, track)
    elif of_quarter:
        dvl = dvl.turned(stands)
    elif felt is not None and _sure(felt, off):
        dvl = dvl.turned(turned)
    else:
        moves = f"as the geometry states it, and it moves as if turned by {_angles(turned)}"
        dvl = dvl.saying("mounting", moves, "instrument")
    return dvl, imu.with_axes(imu.axes, imu.axes_why, known=imu.axes_known or of_quarter)


def _heading(turned: Floats) -> float:
    """Yaw of a frame, rad, from forward to starboard."""
    return float(np.arctan2(turned[1, 0], turned[0, 0]))


def _sure(felt: Match, off_rad: float) -> bool:
    """Whether a mounting is beyond doubt: beyond its noise, and nothing else is far from what is stated."""
    certain = off_rad > SIGMAS * float(felt.part_sd("rotation").max())
    return certain and abs(float(felt.part("scale")[0])) < LARGEST_SCALE and abs(felt.gravity - 9.81) < 0.1


def _angles(turned: Floats) -> str:
    """Roll, pitch and yaw of a frame; of a left-handed one with all its axes reversed."""
    angles = np.rad2deg(to_angles(Rotation.from_matrix(turned * np.linalg.det(turned).round())))
    return ", ".join(
        f"{name} {angle:+.1f}" for name, angle in zip(("roll", "pitch", "yaw"), angles, strict=True)
    )


def _by_accelerations(felt: Match) -> str:
    sd = float(np.rad2deg(felt.part_sd("rotation").max()))
    return (
        f"by its accelerations, {100.0 * felt.explained:.0f} % of which the IMU explains, the DVL's velocity is turned "
        f"by {_angles(felt.turned)} ± {sd:.2g} deg against IMU and attitude"
    )


def _by_track(track: TrackFit) -> str:
    yaw, sd = np.rad2deg(track.angle_rad), np.rad2deg(track.sd_rad)
    told = f"{yaw:+.1f} ± {sd:.2g} deg (agreement {track.agreement:.2f})"
    return f"by its track against the recorded positions by {told}, an error of the heading included"


def _mounted(dvl: DvlPart, track: TrackFit) -> DvlPart:
    """The DVL turned by the yaw of its track, where that is beyond doubt."""
    sure = abs(track.angle_rad) > max(SIGMAS * track.sd_rad, LEAST_YAW_RAD)
    why = "by the positions, which judge the heading no longer by themselves: it may be that of the heading"
    return dvl.turned(_yaw(track.angle_rad)).saying("mounting_yaw_deg", why, "instrument") if sure else dvl


CLEAR = 9.0
"""Difference of the squares of two departures in sigmas from which a yaw is taken to be true."""


def true_or_magnetic(
    attitude: AttitudePart, track: TrackFit, felt: Match | None
) -> tuple[AttitudePart, TrackFit]:
    """Both with the declination taken back, where the track follows positions far better without it.

    It should be that of the accelerations. Without them a DVL mounted at the very angle of the declination cannot be
    told from it; the case says what was decided.

    Args:
        attitude: its yaw is true then.
        track: yaw of the DVL's track with the declination.
        felt: the velocity against the inertial readings, where these tell its axes.
    """
    expected = 0.0 if felt is None else _heading(felt.turned)
    without = track.angle_rad + attitude.declination.value
    off = [
        float(np.angle(np.exp(1j * (yaw - expected)))) / track.sd_rad for yaw in (track.angle_rad, without)
    ]
    if off[0] ** 2 - off[1] ** 2 < CLEAR:
        return attitude, track
    why = (
        "the yaw is true: the track follows the positions without the declination of "
        f"{np.rad2deg(attitude.declination.value):+.1f} deg, which yaw_offset_deg would add"
    )
    return replace(attitude, declination=Guess(0.0, why)), replace(track, angle_rad=without)


def track_yaw(dvl: DvlPart, attitude: AttitudePart | None, positions: PositionPart | None) -> TrackFit | None:
    """Yaw of the velocity by its track against recorded positions; None where these do not tell quarter turns apart.

    The frame of the attitude need not be known: in a wrong one track and positions do not agree.
    """
    if attitude is None or positions is None or len(dvl.time_ns) < 2:
        return None
    times = dvl.on_imu_ns
    platform = attitude.platform()
    usual_s = float(np.median(np.diff(platform.time_ns))) * 1e-9
    known = platform.covers(times, max(LONGEST_STEP_S, USUAL_STEPS * usual_s))
    if known.sum() < 4:
        return None
    times = times[known]
    velocity = platform.at(times).apply(dvl.velocity_p_mps[known])
    way = cumulative_trapezoid(velocity, times * 1e-9 - times[0] * 1e-9, axis=0, initial=0.0)
    track = fit_track("positions", times, way, positions.time_ns, positions.north_east_m)
    tells = track is not None and track.agreement > TRACKED and track.sd_rad < QUARTER_SD_RAD
    return track if tells else None


def _matched(dvl: DvlPart, match: Match | None) -> DvlPart:
    """The DVL with its fit, and with a clock offset that the motion shows beyond doubt."""
    if match is None:
        return dvl.saying("clock", "as recorded: too few pings overlap the IMU's readings to compare them")
    dvl = dvl.matched(match)
    if not match.plausible:
        return dvl.saying("clock", "as recorded, and axes too: the velocity does not follow the IMU")
    clock, sd = float(match.part("clock")[0]), float(match.part_sd("clock")[0])
    if abs(clock) <= max(6.0 * sd, 0.03):
        return dvl
    words = f"the DVL's velocity follows the IMU best when moved by {clock:+.3f} ± {sd:.2g} s"
    why = f"{dvl.offset.why}; {words}" if dvl.offset.why else words
    return replace(dvl, offset=replace(dvl.offset, value=dvl.offset.value + clock, why=why))
