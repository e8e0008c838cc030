"""The inertial readings of a case without any: its attitudes at short steps, and a velocity that persists."""

from dataclasses import replace

import numpy as np

from bottomlock.dead_reckoning.track import attitude_between
from bottomlock.errors import DataError
from bottomlock.recordings.attitude_motion import divided, held, inertial_readings
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.recordings.streams import Attitudes, Beams, Flags, Floats, Inertial, Times
from bottomlock.replay.case import Case
from bottomlock.replay.clock import ClockReport
from bottomlock.replay.motion.pings import ping_velocity
from bottomlock.replay.streams import Streams
from bottomlock.replay.vehicle_motion import vehicle_motion


def inertial_of(
    imu: ImuFromAttitude, attitudes: Attitudes, report: ClockReport, latitude_rad: float, notes: list[str]
) -> Inertial:
    """Readings at short steps between the recorded attitudes; their force is that of a vehicle at rest, 0.

    Raises:
        DataError: for a single attitude, and for a gap that is not declared.
    """
    if len(attitudes.time_ns) < 2:
        raise DataError(
            "has a single row", key="[attitude]", expected='two or more with imu.source = "attitude"'
        )
    report.refuse_long_gap(imu, "[attitude]", "a turn at a constant rate")
    whole_s = max(imu.bridge_gaps_s, report.gap_s)
    time_ns, attitude = divided(attitudes.time_ns, attitudes.attitude, longest_interval_s=whole_s)
    at_rest = np.zeros((len(time_ns), 3))
    omega, force = inertial_readings(time_ns, attitude, at_rest, latitude_rad=latitude_rad)
    notes.append(
        f"imu: readings made from {len(attitudes.time_ns)} attitudes, at {len(time_ns)} times; between pings the "
        "velocity along the vehicle's axes persists"
    )
    if report.gaps.count:
        notes.append(f"imu: gaps of the attitude bridged by a turn at a constant rate: {report.gaps.text}")
    return Inertial(time_ns, force, omega)


def complete_pings(streams: Streams, beams: Beams) -> tuple[Times, Floats]:
    """Times (p,) and velocities (p, 3) of the IMU, platform frame, of the pings whose beams determine all of it."""
    time_ns, velocity = whole_pings(streams, beams)
    return time_ns, at_imu(streams, streams.inertial, time_ns, velocity)


def whole_pings(streams: Streams, beams: Beams) -> tuple[Times, Floats]:
    """The same of the DVL itself."""
    geometry = streams.instrument.geometry
    time_ns, velocity = ping_velocity(
        np.asarray(geometry.directions_p), beams.time_ns, np.nan_to_num(beams.velocity_mps), beams.valid
    )
    return time_ns, velocity / geometry.sound_speed_scale


def at_imu(streams: Streams, inertial: Inertial, time_ns: Times, velocity_p_mps: Floats) -> Floats:
    """(p, 3) velocities carried from the DVL to the IMU over the stated lever arm, with the next reading's rate."""
    lever = np.asarray(streams.instrument.geometry.lever_arms_p_m).mean(axis=0)
    at = np.clip(np.searchsorted(inertial.time_ns, time_ns), 0, len(inertial.time_ns) - 1)
    return np.asarray(velocity_p_mps - np.cross(inertial.omega_p_radps[at], lever))


def with_persistence(case: Case, streams: Streams, valid: Flags) -> Inertial:
    """The readings with the force under which the velocity of the last complete ping persists.

    Readings of an IMU are returned as they are.

    Args:
        case: the case.
        streams: its recording.
        valid: (n, B) the beams that the filter may know of.
    """
    inertial = streams.inertial
    if not isinstance(case.imu, ImuFromAttitude):
        return inertial
    assert streams.attitudes is not None  # validated in Case
    velocity = held(inertial.time_ns, *complete_pings(streams, replace(streams.beams, valid=valid)))
    attitude = attitude_between(streams.attitudes)(inertial.time_ns)
    omega, force = inertial_readings(inertial.time_ns, attitude, velocity, latitude_rad=streams.latitude_rad)
    return Inertial(inertial.time_ns, force, omega)


def with_vehicle_motion(case: Case, streams: Streams) -> Streams:
    """The streams with the vehicle's motion as its pings show it, where that is the prior or the noise of the filter.

    Raises:
        DataError: for too few complete pings where the case does not state the noise of the accelerations.
    """
    if not isinstance(case.imu, ImuFromAttitude):
        return streams
    states_noise = case.imu.errors.accel_noise_mps_per_rt_h is not None
    if states_noise and "motion" in case.filter.model_fields_set:
        return streams
    try:
        motion = vehicle_motion(*complete_pings(streams, streams.beams))
    except DataError as error:
        if states_noise:
            return replace(streams, notes=(*streams.notes, f"imu: no prior of the velocity: {error}"))
        raise
    prior = motion.prior
    parts = (
        f"{key} = [{', '.join(f'{value:.3g}' for value in getattr(prior, key))}]"
        for key in ("mean_sd_mps", "change_sd_mps", "change_time_s")
    )
    note = f"imu: the vehicle's motion by {motion.pings} complete pings, as a prior: filter.motion {'; '.join(parts)}"
    return replace(streams, vehicle_motion=motion, notes=(*streams.notes, note))
