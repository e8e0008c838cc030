"""Initial alignment of a replay: each part of the state from the source that the case names, with its 1 sigma."""

from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock.errors import DataError
from bottomlock.kernel import EARTH_RATE_RADPS, solve_velocity
from bottomlock.kernel.models import Environment, ImuModel
from bottomlock.recordings.axes import from_angles, to_angles
from bottomlock.recordings.rotation import level_from_force
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.recordings.streams import Floats, Inertial, Times
from bottomlock.replay.case import FROM_REFERENCE, Case
from bottomlock.replay.streams import Streams
from bottomlock.replay.vehicle_motion import level_axes

BLOCKS = 10
"""Number of blocks of a window: scatter slower than the sampling then still counts."""


def mean_over(values: Floats, section: str, window_s: float) -> tuple[Floats, Floats]:
    """Mean (3,) of (n, 3) readings and its standard deviation (3,), from the means of ten consecutive blocks.

    Readings of a vehicle in waves are correlated; means over a tenth of the window are nearly independent.

    Raises:
        DataError: for fewer readings than blocks.

    >>> [part.tolist() for part in mean_over(np.tile([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], (50, 1)), "imu", 10.0)]
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """
    if len(values) < BLOCKS:
        raise DataError(
            f"[{section}] has {len(values)} rows in the {window_s:g} s before the start",
            expected=f"{BLOCKS} or more",
            hint="lengthen start.window_s or set a later start.at_s",
        )
    blocks = np.stack([block.mean(axis=0) for block in np.array_split(values, BLOCKS)])
    return values.mean(axis=0), np.asarray(blocks.std(axis=0, ddof=1) / np.sqrt(BLOCKS))


T = TypeVar("T")


def _given(part: T | None) -> T:
    """What the case has, as it was validated."""
    assert part is not None
    return part


NEEDS_WINDOW = {"levelling", "gyrocompass"}
"""Sources that average the readings of a window before the start."""
PING_AGE_S = 5.0
"""Greatest age of the ping that gives the initial velocity."""
MAX_RATE_AT_REST_RADPS = np.deg2rad(0.05)
"""Gyrocompassing is rejected when the mean rate over the window exceeds this: 12 times the Earth's rate."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """Initial state, 1 sigma of each part, and the source of each.

    Attributes:
        time_ns: start time on the case's clock.
        position_t_m, velocity_p_mps: (3,), tangent and platform frame.
        attitude: rotation from platform to tangent frame.
        position_sd_m, velocity_sd_mps: (3,), tangent and platform frame.
        attitude_sd_rad: (3,) about north, east and down.
        sources: a phrase for each part: where it came from and its 1 sigma.
    """

    time_ns: int
    position_t_m: Floats
    attitude: Rotation
    velocity_p_mps: Floats
    position_sd_m: Floats
    attitude_sd_rad: Floats
    velocity_sd_mps: Floats
    sources: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _AlignmentInputs:
    """Inputs of the alignment: case, streams, assumed IMU errors, gravity, start time, row of the reference."""

    case: Case
    streams: Streams
    imu: ImuModel
    gravity_mps2: float
    start_ns: int
    reference_row: int | None

    @property
    def window_ns(self) -> int:
        """Begin of the window before the start."""
        return self.start_ns - round(self.case.start.window_s * 1e9)

    @property
    def window(self) -> Inertial:
        """IMU readings of the window before the start."""
        times = self.streams.inertial.time_ns
        return self.streams.inertial.rows(slice(*np.searchsorted(times, [self.window_ns, self.start_ns + 1])))


def align(case: Case, streams: Streams, imu: ImuModel, gravity_mps2: float) -> Alignment:
    """Computes the initial state from the sources that the case's [start] names.

    Args:
        case: the case.
        streams: its recording.
        imu: assumed IMU errors, which give the 1 sigma of levelling and gyrocompassing.
        gravity_mps2: gravity, for levelling.

    Raises:
        DataError: naming the section, where a source has no data at the start, needs a longer window than there is,
            or cannot be used in this motion.
    """
    start_ns, row = start_time(case, streams)
    inputs = _AlignmentInputs(case, streams, imu, gravity_mps2, start_ns, row)
    roll, pitch, level_sd, level_source = _level(inputs)
    heading, heading_sd, heading_source = _heading(inputs, roll, pitch)
    start = case.start
    level_sd = level_sd if start.level_sd_deg is None else float(np.deg2rad(start.level_sd_deg))
    heading_sd = heading_sd if start.heading_sd_deg is None else float(np.deg2rad(start.heading_sd_deg))
    attitude = from_angles(roll, pitch, heading)
    position, position_sd, position_source = _position(inputs, attitude)
    velocity, velocity_sd, velocity_source = _velocity(inputs)
    environment = Environment(
        latitude_rad=streams.latitude_rad, gravity_mps2=gravity_mps2, earth=case.origin.earth
    )
    # Level and heading are those of the place; the tangent frame is that of the origin.
    attitude = level_axes(environment, position[None])[0] * attitude
    return Alignment(
        time_ns=start_ns,
        position_t_m=position,
        attitude=attitude,
        velocity_p_mps=velocity,
        position_sd_m=position_sd,
        attitude_sd_rad=np.array([level_sd, level_sd, heading_sd]),
        velocity_sd_mps=velocity_sd,
        sources={
            "start": f"{(start_ns - streams.inertial.time_ns[0]) * 1e-9:.3f} s after the first inertial reading",
            "level": f"{level_source}; 1 sigma {np.rad2deg(level_sd):.3g} deg",
            "heading": f"{heading_source}, from true north at the start; 1 sigma {np.rad2deg(heading_sd):.3g} deg",
            "position": f"{position_source}; 1 sigma {_three(position_sd)} m",
            "velocity": f"{velocity_source}; 1 sigma {_three(velocity_sd)} m/s",
        },
    )


def start_time(case: Case, streams: Streams) -> tuple[int, int | None]:
    """Start time, ns, and the row of the reference at that time, None where no part comes from the reference.

    Raises:
        DataError: where the alignment window begins before the recording, or the recording ends before the start.
    """
    start, times = case.start, streams.inertial.time_ns
    windowed = bool({start.level, start.heading} & NEEDS_WINDOW)
    if start.at_s is None:
        earliest = int(times[0]) + (round(start.window_s * 1e9) if windowed else 0)
    else:
        earliest = int(times[0]) + round(start.at_s * 1e9)
        if windowed and start.at_s < start.window_s:
            raise DataError(
                f"is {start.at_s:g} s",
                key="start.at_s",
                expected=f"{start.window_s:g} s (start.window_s) or more: the alignment averages the readings before "
                "the start",
            )
    if earliest >= times[-1]:
        raise DataError(
            f"ends {(times[-1] - times[0]) * 1e-9:.3f} s after its first reading, before the start at "
            f"{(earliest - times[0]) * 1e-9:.3f} s",
            place=case.motion_file,
        )
    if not start.from_reference:
        return int(times[np.searchsorted(times, earliest)]), None
    stamps = _given(streams.reference).time_ns
    row = int(np.searchsorted(stamps, earliest))
    if row == len(stamps) or stamps[row] >= times[-1]:
        raise DataError(
            "has no row between the start and the end of the inertial readings", key="[reference]"
        )
    return int(stamps[row]), row


def _latest(times: Times, inputs: _AlignmentInputs, section: str, age_s: float) -> int:
    """Row of the latest reading at or before the start, at most `age_s` old."""
    row = int(np.searchsorted(times, inputs.start_ns, side="right")) - 1
    if row < 0 or inputs.start_ns - times[row] > age_s * 1e9:
        raise DataError(
            f"[{section}] has no row in the {age_s:g} s before the start",
            hint="set a later start with start.at_s",
        )
    return row


def _three(values: Floats) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _level(inputs: _AlignmentInputs) -> tuple[float, float, float, str]:
    """Roll and pitch, rad, their 1 sigma, and the source."""
    start = inputs.case.start
    if start.level == "given":
        return float(np.deg2rad(start.roll_deg)), float(np.deg2rad(start.pitch_deg)), np.nan, "given"
    if start.level == FROM_REFERENCE:
        angles = _reference_angles(inputs)
        return float(angles[0]), float(angles[1]), np.nan, "from the reference"
    if start.level == "attitude":
        angles, source = _recorded_angles(inputs)
        sd = float(np.deg2rad(_given(inputs.case.attitude).start_roll_pitch_sd_deg))
        return float(angles[0]), float(angles[1]), sd, source
    force, force_sd = mean_over(inputs.window.force_p_mps2, "imu", inputs.case.start.window_s)
    roll, pitch = level_from_force(force)
    sd = float(np.hypot(inputs.imu.accel_bias_sd_mps2, force_sd.max())) / inputs.gravity_mps2
    return roll, pitch, sd, f"levelled by the accelerometers over {start.window_s:g} s"


def _heading(inputs: _AlignmentInputs, roll: float, pitch: float) -> tuple[float, float, str]:
    """Heading, rad, its 1 sigma, and the source."""
    start = inputs.case.start
    if start.heading == "given":
        return float(np.deg2rad(start.heading_deg)), np.nan, f"given, {start.heading_deg:g} deg"
    if start.heading == FROM_REFERENCE:
        return float(_reference_angles(inputs)[2]), np.nan, "from the reference"
    if start.heading == "attitude":
        angles, source = _recorded_angles(inputs)
        return float(angles[2]), float(np.deg2rad(_given(inputs.case.attitude).start_yaw_sd_deg)), source
    return _gyrocompass(inputs, roll, pitch)


def _reference_angles(inputs: _AlignmentInputs) -> Floats:
    return to_angles(_given(_given(inputs.streams.reference).attitude)[_given(inputs.reference_row)])


def _recorded_angles(inputs: _AlignmentInputs) -> tuple[Floats, str]:
    recorded = _given(inputs.streams.attitudes)
    if isinstance(inputs.case.imu, ImuFromAttitude):
        # The readings turn from the attitude of this very time.
        now = recorded.at(np.array([inputs.start_ns]))
        return to_angles(now)[0], "from the recorded attitude"
    row = _latest(recorded.time_ns, inputs, "attitude", 1.0)
    age = (inputs.start_ns - int(recorded.time_ns[row])) * 1e-9
    return to_angles(recorded.attitude[row]), f"from the recorded attitude {age:.3f} s before"


def _gyrocompass(inputs: _AlignmentInputs, roll: float, pitch: float) -> tuple[float, float, str]:
    """Heading from the Earth's rate, whose horizontal component points north.

    Source: Titterton and Weston 2004, section 10.5.
    """
    rate, rate_sd = mean_over(inputs.window.omega_p_radps, "imu", inputs.case.start.window_s)
    size = float(np.linalg.norm(rate))
    if size > MAX_RATE_AT_REST_RADPS:
        raise DataError(
            f'start.heading = "gyrocompass": the mean rate is {np.rad2deg(size):.3g} deg/s over the window',
            expected=f"less than {np.rad2deg(MAX_RATE_AT_REST_RADPS):.2g}: the vehicle must be at rest",
        )
    # Rotated through roll and pitch alone, into the level frame of the same heading.
    north, east, _ = from_angles(roll, pitch, 0.0).apply(rate)
    horizontal = EARTH_RATE_RADPS * float(np.cos(inputs.streams.latitude_rad))
    heading = float(np.arctan2(-east, north))
    error = float(np.hypot(inputs.imu.gyro_bias_sd_radps, rate_sd.max()))
    if error > 0.5 * horizontal:
        raise DataError(
            f'start.heading = "gyrocompass": the mean rate has an error of {error:.2g} rad/s (bias and scatter)',
            expected=f"at most half the Earth's horizontal rate here, {horizontal:.2g} rad/s: the gyros are not "
            "accurate enough, or start.window_s is too short",
        )
    return heading, error / horizontal, f"gyrocompass over {inputs.case.start.window_s:g} s"


def _position(inputs: _AlignmentInputs, attitude: Rotation) -> tuple[Floats, Floats, str]:
    start = inputs.case.start
    given_sd = np.zeros(3) if start.position_sd_m is None else np.array(start.position_sd_m)
    if start.position == FROM_REFERENCE:
        position = _given(_given(inputs.streams.reference).position_t_m)
        return position[inputs.reference_row], given_sd, "from the reference"
    if start.position == "gps":
        positions, stream = _given(inputs.streams.gps), _given(inputs.case.gps)
        row = _latest(positions.time_ns, inputs, "gps", 5.0)
        sd = np.array(stream.position_sd_m) if start.position_sd_m is None else given_sd
        return positions.position_t_m[row] - attitude.apply(np.array(stream.lever_arm_m)), sd, "from GPS"
    return np.array(start.position_m), given_sd, "given"


def _velocity(inputs: _AlignmentInputs) -> tuple[Floats, Floats, str]:
    start, streams = inputs.case.start, inputs.streams
    sd = np.array(start.velocity_sd_mps)
    if start.velocity == FROM_REFERENCE:
        velocity = _given(_given(streams.reference).velocity_p_mps)
        return velocity[inputs.reference_row], sd, "from the reference"
    if start.velocity == "given":
        return np.array(start.velocity_mps), sd, "given"
    beams, geometry = streams.beams, streams.instrument.geometry
    row = _latest(beams.time_ns, inputs, "dvl", PING_AGE_S)
    inertial = streams.inertial
    nearest = int(np.searchsorted(inertial.time_ns, beams.time_ns[row]).clip(0, len(inertial.time_ns) - 1))
    ping, age = slice(row, row + 1), (inputs.start_ns - int(beams.time_ns[row])) * 1e-9
    fix = solve_velocity(
        geometry,
        beams.velocity_mps[ping],
        beams.valid[ping],
        method="lc",
        beam_sd_mps=beams.sd_mps[row],
        omega_tp_p_radps=inertial.omega_p_radps[nearest : nearest + 1],
    )
    if not np.isfinite(fix.velocity_p_mps).all():
        raise DataError(
            f'start.velocity = "beams": the ping {age:.3f} s before the start has too few valid beams for a velocity',
            hint="move start.at_s or give start.velocity_mps",
        )
    # The stated velocity_sd_mps covers the change of speed since the ping.
    solved_sd = np.sqrt(np.diagonal(fix.cov_m2ps2[0]) + sd**2)
    return fix.velocity_p_mps[0], solved_sd, f"least squares over the ping {age:.3f} s before"
