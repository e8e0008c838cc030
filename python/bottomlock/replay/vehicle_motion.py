"""How a vehicle's velocity changes along its own axes, and the readings of a case without inertial ones made of that.

Its attitudes are taken at short steps, and the velocity of the last complete ping persists between pings.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from bottomlock.dead_reckoning.track import structure_function
from bottomlock.errors import DataError
from bottomlock.kernel import local_earth
from bottomlock.kernel.models import Environment
from bottomlock.recordings.attitude_motion import divided, held, inertial_readings
from bottomlock.recordings.pings import ping_velocity
from bottomlock.recordings.stream_sections import ImuFromAttitude
from bottomlock.recordings.streams import Attitudes, Beams, Flags, Floats, Inertial, Times
from bottomlock.replay.case import Case
from bottomlock.replay.clock import ClockReport
from bottomlock.replay.streams import Streams, VehicleMotion


def level_axes(environment: Environment, position_t_m: ArrayLike) -> Rotation:
    """(n,) rotations from north, east and down at positions (n, 3), m, to the tangent frame."""
    position = np.nan_to_num(np.asarray(position_t_m, dtype=np.float64))
    if environment.earth == "tangent_plane":
        return Rotation.identity(len(position))
    return Rotation.from_matrix(local_earth(environment, position)["rotation_t_n"])


LONGEST_LAG_S = 300.0
"""Times over which a vehicle that has lost the bottom has to be predicted."""
TIMES_S = np.geomspace(10.0, 2000.0, 30)
"""Correlation times that are tried; what changes faster is taken for noise of the DVL."""
FEWEST_LAGS = 4
"""Lags from which three numbers are fitted."""


def vehicle_motion(pinged_ns: Times, velocity_p_mps: Floats) -> VehicleMotion:
    """Fits D(t) = 2 r² + 2 σ² (1 − exp(−t/τ)) to the mean squared difference of pings t apart, per axis.

    Args:
        pinged_ns: (p,) rising times of complete pings.
        velocity_p_mps: (p, 3) their velocities, platform axes.

    Raises:
        DataError: for too few pings.
    """
    measured = structure_function(pinged_ns, velocity_p_mps, np.zeros(3))
    rows = np.zeros(0, dtype=np.int64)
    if measured is not None:
        rows = np.flatnonzero((measured.lag_s > 0.0) & (measured.lag_s <= LONGEST_LAG_S))
    if measured is None or len(rows) < FEWEST_LAGS:
        raise DataError(
            f"the accelerations of the vehicle cannot be measured on {len(pinged_ns)} pings with a whole velocity: "
            "give imu.errors.accel_noise_mps_per_rt_h"
        )
    fits = np.array([_fit(measured.lag_s[rows], square) for square in measured.change_m2ps2[rows].T])
    return VehicleMotion(
        fluctuation_sd_mps=fits[:, 1], fluctuation_time_s=fits[:, 2], white_sd_mps=fits[:, 0],
        mean_mps=velocity_p_mps.mean(axis=0), pings=len(pinged_ns),
    )  # fmt: skip


def _fit(lags_s: Floats, squares: Floats) -> tuple[float, float, float]:
    """White noise, fluctuation (1 sigma) and correlation time of an axis, each lag with the same relative weight."""
    weight = 1.0 / np.maximum(squares, 1e-12)
    fits = []
    for time_s in TIMES_S:
        columns = np.stack([np.full(len(lags_s), 2.0), 2.0 * (1.0 - np.exp(-lags_s / time_s))], axis=1)
        parts, misfit = nnls(columns * weight[:, None], squares * weight)
        fits.append((misfit, *np.sqrt(parts), time_s))
    return min(fits)[1:]


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
    attitude = streams.attitudes.at(inertial.time_ns)
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
