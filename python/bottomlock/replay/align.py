"""The state at the start of a replay, each part from where the case says, with its stated standard deviation."""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError
from bottomlock.kernel import EARTH_RATE_RADPS, solve_velocity
from bottomlock.replay.axes import from_angles, to_angles
from bottomlock.replay.case import FROM_REFERENCE, Case
from bottomlock.replay.dive import Dive, Floats, Inertial, Times
from bottomlock.replay.model import ImuModel
from bottomlock.replay.window_mean import mean_over

LISTENS = {"levelling", "magnetometer", "gps_course", "gyrocompass"}
"""Sources that need a window of readings before the start."""
PING_AGE_S = 5.0
"""How old the ping may be whose velocity the navigation starts with."""
COURSE_SLIP_RAD = np.deg2rad(3.0)
"""How far the bow points off the course, 1 sigma: sideslip and current, of which GPS knows nothing."""
STILL_RATE_RADPS = np.deg2rad(0.05)
"""A gyrocompass is refused when the vehicle turns faster than this over the window: 12 times the Earth's rate."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """State at the start, 1 sigma of each part, and in words how it was found.

    Attributes:
        time_ns: of the start.
        position_t_m, velocity_p_mps: (3,).
        attitude: platform to tangent.
        position_sd_m, velocity_sd_mps: (3,).
        attitude_sd_rad: (3,) about north, east and down.
        words: a sentence for each part.
    """

    time_ns: int
    position_t_m: Floats
    attitude: Rotation
    velocity_p_mps: Floats
    position_sd_m: Floats
    attitude_sd_rad: Floats
    velocity_sd_mps: Floats
    words: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Moment:
    """What an alignment works with: the recording up to the start, and what is assumed of its sensors."""

    case: Case
    dive: Dive
    imu: ImuModel
    gravity_mps2: float
    start_ns: int
    reference_row: int | None

    @property
    def window(self) -> Inertial:
        """The inertial readings of the window before the start."""
        inertial = self.dive.inertial
        return _between(inertial, self.start_ns - round(self.case.start.window_s * 1e9), self.start_ns)


def align(case: Case, dive: Dive, imu: ImuModel, gravity_mps2: float) -> Alignment:
    """The state at the start, as the case's [start] asks.

    Raises:
        DataError: naming the section, where a source has no data at the start, listens longer than there is, or is
        of no use
            in the motion at hand.
    """
    start_ns, row = start_time(case, dive)
    moment = _Moment(case, dive, imu, gravity_mps2, start_ns, row)
    roll, pitch, level_sd, level_words = _level(moment)
    heading, heading_sd, heading_words = _heading(moment, roll, pitch)
    start = case.start
    level_sd = level_sd if start.level_sd_deg is None else float(np.deg2rad(start.level_sd_deg))
    heading_sd = heading_sd if start.heading_sd_deg is None else float(np.deg2rad(start.heading_sd_deg))
    attitude = from_angles(roll, pitch, heading)
    position, position_sd, position_words = _position(moment, attitude)
    velocity, velocity_sd, velocity_words = _velocity(moment)
    return Alignment(
        time_ns=start_ns,
        position_t_m=position,
        attitude=attitude,
        velocity_p_mps=velocity,
        position_sd_m=position_sd,
        attitude_sd_rad=np.array([level_sd, level_sd, heading_sd]),
        velocity_sd_mps=velocity_sd,
        words={
            "start": f"{(start_ns - dive.inertial.time_ns[0]) * 1e-9:.3f} s after the first inertial reading",
            "level": f"{level_words}; 1 sigma {np.rad2deg(level_sd):.3g} deg",
            "heading": f"{heading_words}; 1 sigma {np.rad2deg(heading_sd):.3g} deg",
            "position": f"{position_words}; 1 sigma {_three(position_sd)} m",
            "velocity": f"{velocity_words}; 1 sigma {_three(velocity_sd)} m/s",
        },
    )


def start_time(case: Case, dive: Dive) -> tuple[int, int | None]:
    """When the navigation starts, and the row of the reference that stands there, if parts come from it.

    Raises:
        DataError: where the window does not fit before it, or the recording ends first.
    """
    start, times = case.start, dive.inertial.time_ns
    listens = bool({start.level, start.heading} & LISTENS)
    if start.at_s is None:
        earliest = int(times[0]) + (round(start.window_s * 1e9) if listens else 0)
    else:
        earliest = int(times[0]) + round(start.at_s * 1e9)
        if listens and start.at_s < start.window_s:
            raise DataError(
                f"start.at_s is {start.at_s:g} s, expected {start.window_s:g} s (start.window_s) or more: the "
                "alignment listens before the start"
            )
    if earliest >= times[-1]:
        raise DataError(
            f"{case.imu.file}: ends {(times[-1] - times[0]) * 1e-9:.3f} s after its first reading, before the start at "
            f"{(earliest - times[0]) * 1e-9:.3f} s"
        )
    if not start.from_reference:
        return int(times[np.searchsorted(times, earliest)]), None
    assert dive.reference is not None  # the case demands it
    row = int(np.searchsorted(dive.reference.time_ns, earliest))
    if row == len(dive.reference.time_ns) or dive.reference.time_ns[row] >= times[-1]:
        raise DataError("[reference] has no row between the start and the end of the inertial readings")
    return int(dive.reference.time_ns[row]), row


def _between(inertial: Inertial, from_ns: int, to_ns: int) -> Inertial:
    rows = slice(*np.searchsorted(inertial.time_ns, [from_ns, to_ns + 1]))
    return Inertial(inertial.time_ns[rows], inertial.force_p_mps2[rows], inertial.omega_p_radps[rows])


def _latest(times: Times, moment: _Moment, section: str, age_s: float) -> int:
    """The last row at or before the start."""
    row = int(np.searchsorted(times, moment.start_ns, side="right")) - 1
    if row < 0 or moment.start_ns - times[row] > age_s * 1e9:
        raise DataError(
            f"[{section}] has nothing in the {age_s:g} s before the start; start.at_s moves the start"
        )
    return row


def _three(values: Floats) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _level(moment: _Moment) -> tuple[float, float, float, str]:
    """Roll, pitch, their standard deviation, and words."""
    start = moment.case.start
    if start.level == "given":
        return float(np.deg2rad(start.roll_deg)), float(np.deg2rad(start.pitch_deg)), np.nan, "given"
    if start.level == FROM_REFERENCE:
        angles = _reference_angles(moment)
        return float(angles[0]), float(angles[1]), np.nan, "of the reference"
    if start.level == "attitude":
        angles, row_words = _recorded_angles(moment)
        stream = moment.case.attitude
        assert stream is not None  # the case demands it
        return float(angles[0]), float(angles[1]), float(np.deg2rad(stream.roll_pitch_sd_deg)), row_words
    force = mean_over(moment.window.force_p_mps2, "imu", moment.case.start.window_s)
    roll, pitch = level_from_force(force.value)
    sd = float(np.hypot(moment.imu.accel_bias_sd_mps2, force.sd.max())) / moment.gravity_mps2
    words = f"levelled by the accelerometers over {start.window_s:g} s"
    return roll, pitch, sd, words


def level_from_force(force_p_mps2: Floats) -> tuple[float, float]:
    """Roll and pitch, rad, of a platform at rest that reads a specific force: it points up.

    >>> level_from_force(np.array([0.0, 0.0, -9.81]))
    (0.0, 0.0)
    >>> [round(angle, 6) for angle in level_from_force(from_angles(0.1, 0.2, 1.0).inv().apply([0.0, 0.0, -9.81]))]
    [0.1, 0.2]
    """
    x, y, z = (float(part) for part in force_p_mps2)
    # + 0.0 turns a negative zero into a plain one.
    return float(np.arctan2(-y, -z)) + 0.0, float(np.arctan2(x, np.hypot(y, z))) + 0.0


def _heading(moment: _Moment, roll: float, pitch: float) -> tuple[float, float, str]:
    """Heading, its standard deviation, and words."""
    start = moment.case.start
    if start.heading == "given":
        return float(np.deg2rad(start.heading_deg)), np.nan, f"given, {start.heading_deg:g} deg"
    if start.heading == FROM_REFERENCE:
        return float(_reference_angles(moment)[2]), np.nan, "of the reference"
    if start.heading == "attitude":
        angles, words = _recorded_angles(moment)
        stream = moment.case.attitude
        assert stream is not None  # the case demands it
        return float(angles[2]), float(np.deg2rad(stream.yaw_sd_deg)), words
    if start.heading == "magnetometer":
        return _magnetic(moment, roll, pitch)
    if start.heading == "gps_course":
        return _course(moment)
    return _gyrocompass(moment, roll, pitch)


def _reference_angles(moment: _Moment) -> Floats:
    reference = moment.dive.reference
    assert reference is not None  # the case demands both
    assert reference.attitude is not None
    assert moment.reference_row is not None
    return to_angles(reference.attitude[moment.reference_row])


def _recorded_angles(moment: _Moment) -> tuple[Floats, str]:
    recorded = moment.dive.attitudes
    assert recorded is not None  # the case demands it
    row = _latest(recorded.time_ns, moment, "attitude", 1.0)
    age = (moment.start_ns - int(recorded.time_ns[row])) * 1e-9
    return to_angles(recorded.attitude[row]), f"of the recorded attitude {age:.3f} s before"


def _level_frame(roll: float, pitch: float, vector_p: Floats) -> Floats:
    """A platform vector turned level, its heading left as it is."""
    return np.asarray(from_angles(roll, pitch, 0.0).apply(vector_p))


def _magnetic(moment: _Moment, roll: float, pitch: float) -> tuple[float, float, str]:
    fields, stream = moment.dive.fields, moment.case.magnetometer
    assert fields is not None  # the case demands both
    assert stream is not None
    rows = slice(*np.searchsorted(fields.time_ns, [_window_ns(moment), moment.start_ns + 1]))
    mean = mean_over(fields.field_p[rows], "magnetometer", moment.case.start.window_s)
    north, east, _ = _level_frame(roll, pitch, mean.value)
    heading = float(np.arctan2(-east, north) + np.deg2rad(stream.declination_deg))
    words = f"magnetic over {moment.case.start.window_s:g} s, declination {stream.declination_deg:g} deg"
    return heading, float(np.deg2rad(stream.heading_sd_deg)), words


def _window_ns(moment: _Moment) -> int:
    return moment.start_ns - round(moment.case.start.window_s * 1e9)


def _course(moment: _Moment) -> tuple[float, float, str]:
    positions, stream = moment.dive.positions, moment.case.gps
    assert positions is not None  # the case demands both
    assert stream is not None
    rows = np.arange(*np.searchsorted(positions.time_ns, [_window_ns(moment), moment.start_ns + 1]))
    if len(rows) < 2:
        raise DataError(f"[gps] has {len(rows)} positions in the window before the start, expected 2 or more")
    north, east, _ = positions.position_t_m[rows[-1]] - positions.position_t_m[rows[0]]
    way = float(np.hypot(north, east))
    across = float(np.sqrt(2.0) * max(stream.position_sd_m[:2]))
    if way < 2.0 * across:
        raise DataError(
            f'start.heading = "gps_course": the antenna moved {way:.2f} m over the window, expected more than '
            f"{2.0 * across:.2f} m, twice its own uncertainty: no course to take"
        )
    words = f"course of the GPS over {way:.1f} m, the bow taken to point along it"
    return float(np.arctan2(east, north)), float(np.hypot(across / way, COURSE_SLIP_RAD)), words


def _gyrocompass(moment: _Moment, roll: float, pitch: float) -> tuple[float, float, str]:
    """Heading from the Earth's rate: its horizontal part points north (Titterton and Weston 2004, section 10.5)."""
    window = moment.window
    rate = mean_over(window.omega_p_radps, "imu", moment.case.start.window_s)
    if float(np.linalg.norm(rate.value)) > STILL_RATE_RADPS:
        raise DataError(
            f'start.heading = "gyrocompass": the vehicle turns {np.rad2deg(np.linalg.norm(rate.value)):.3g} deg/s over '
            f"the window, expected less than {np.rad2deg(STILL_RATE_RADPS):.2g}: it needs a vehicle at rest"
        )
    north, east, _ = _level_frame(roll, pitch, rate.value)
    horizontal = EARTH_RATE_RADPS * float(np.cos(moment.dive.latitude_rad))
    heading = float(np.arctan2(-east, north))
    error = float(np.hypot(moment.imu.gyro_bias_sd_radps, rate.sd.max()))
    if error > 0.5 * horizontal:
        raise DataError(
            f'start.heading = "gyrocompass": the mean rate is known to {error:.2g} rad/s (bias and scatter), and the '
            f"Earth's horizontal rate here is {horizontal:.2g} rad/s, expected twice as much: the gyros are too poor, "
            "or start.window_s too short"
        )
    return heading, error / horizontal, f"gyrocompass over {moment.case.start.window_s:g} s"


def _position(moment: _Moment, attitude: Rotation) -> tuple[Floats, Floats, str]:
    start = moment.case.start
    given_sd = np.array(start.position_sd_m)
    if start.position == FROM_REFERENCE:
        reference = moment.dive.reference
        assert reference is not None  # the case demands both
        assert reference.position_t_m is not None
        return reference.position_t_m[moment.reference_row], given_sd, "of the reference"
    if start.position == "gps":
        positions, stream = moment.dive.positions, moment.case.gps
        assert positions is not None  # the case demands both
        assert stream is not None
        row = _latest(positions.time_ns, moment, "gps", 5.0)
        sd = given_sd if given_sd.any() else np.array(stream.position_sd_m)
        return positions.position_t_m[row] - attitude.apply(np.array(stream.lever_arm_m)), sd, "of the GPS"
    return np.array(start.position_m), given_sd, "given"


def _velocity(moment: _Moment) -> tuple[Floats, Floats, str]:
    start, dive = moment.case.start, moment.dive
    sd = np.array(start.velocity_sd_mps)
    if start.velocity == FROM_REFERENCE:
        reference = dive.reference
        assert reference is not None  # the case demands both
        assert reference.velocity_p_mps is not None
        return reference.velocity_p_mps[moment.reference_row], sd, "of the reference"
    if start.velocity == "given":
        return np.array(start.velocity_mps), sd, "given"
    beams, geometry = dive.beams, dive.instrument.geometry
    row = _latest(beams.time_ns, moment, "dvl", PING_AGE_S)
    inertial = dive.inertial
    nearest = int(np.searchsorted(inertial.time_ns, beams.time_ns[row]).clip(0, len(inertial.time_ns) - 1))
    ping = slice(row, row + 1)
    fix = solve_velocity(
        geometry,
        beams.velocity_mps[ping],
        beams.valid[ping],
        method="lc",
        beam_sd_mps=beams.sd_mps[row],
        rate_tp_p_radps=inertial.omega_p_radps[nearest : nearest + 1],
    )
    if not np.isfinite(fix.velocity_p_mps).all():
        raise DataError(
            f'start.velocity = "beams": the ping {(moment.start_ns - beams.time_ns[row]) * 1e-9:.3f} s before the '
            "start, has too few beams for a velocity"
        )
    age = (moment.start_ns - int(beams.time_ns[row])) * 1e-9
    # The vehicle may have changed its speed since: what the case states covers that.
    solved_sd = np.sqrt(np.diagonal(fix.cov_m2ps2[0]) + sd**2)
    return fix.velocity_p_mps[0], solved_sd, f"least squares over the ping {age:.3f} s before"
