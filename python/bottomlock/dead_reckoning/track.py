"""Dead reckoning: the DVL's velocity, turned by a recorded attitude and summed up to a position.

No inertial reading is used and nothing is estimated, so this is the floor that a filter has to reach. The velocity of a
ping is held until the next ping that has a whole one. With C the attitude, p_d the place of the DVL and l its lever arm
from the IMU

    p_d(t) = p_d(0) + ∫ C v_d dt,    p(t) = p_d(t) − C(t) l

so the lever arm needs no angular rate. Where a depth sensor is there, it gives the vertical.

Source: Brokloff, "Matrix Algorithm for Doppler Sonar Navigation", OCEANS 1994.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from bottomlock.dead_reckoning.track_sd import (
    AttitudeErrors,
    VelocityErrors,
    attitude_cov,
    held_cov,
    outer,
    summed,
)
from bottomlock.recordings.streams import Attitudes, Depths, Flags, Floats, Times

AttitudeAt = Callable[[Times], Rotation]


@dataclass(frozen=True, eq=False)
class Velocities:
    """Whole velocities of the DVL in platform axes: times (p,), values (p, 3), covariances of their noise (p, 3, 3)."""

    time_ns: Times
    velocity_p_mps: Floats
    cov_m2ps2: Floats


@dataclass(frozen=True, eq=False)
class DepthAid:
    """Depths below the origin, their 1 sigma in m, and the sensor's place from the IMU, platform axes, m (3,)."""

    depths: Depths
    sd_m: float
    lever_p_m: Floats


@dataclass(frozen=True, eq=False)
class Begin:
    """State at the start: time, position (3,) and velocity (3,) of the IMU, and their 1 sigma (3,) each."""

    time_ns: int
    position_t_m: Floats
    velocity_p_mps: Floats
    position_sd_m: Floats
    velocity_sd_mps: Floats


@dataclass(frozen=True, eq=False)
class Reckoned:
    """Position and velocity of the IMU, (T, 3), the attitude, and 1 sigma or covariance of each.

    Position in the tangent frame, m, with its covariance (T, 3, 3); velocity in platform axes, m/s, (T, 3, 3);
    `attitude_sd_rad` (3,) about the tangent axes.
    """

    position_t_m: Floats
    position_cov_m2: Floats
    velocity_p_mps: Floats
    velocity_cov_m2ps2: Floats
    attitude: Rotation
    attitude_sd_rad: Floats


def dead_reckon(
    velocities: Velocities,
    attitudes: Attitudes,
    begin: Begin,
    sample_ns: Times,
    *,
    velocity_errors: VelocityErrors,
    attitude_errors: AttitudeErrors,
    lever_p_m: Floats | None = None,
    omega_p_radps: Floats | None = None,
    depth: DepthAid | None = None,
) -> Reckoned:
    """Position, velocity and attitude at `sample_ns` (T,), which rises from the start on.

    Args:
        velocities: of the pings after the start; before the first of them the start's velocity is held.
        attitudes: two or more; before the first and after the last that one holds.
        begin: the state at the start.
        sample_ns: times of the estimates.
        velocity_errors: beyond the noise of a ping.
        attitude_errors: of the recorded attitude.
        lever_p_m: (3,) of the DVL from the IMU.
        omega_p_radps: (T, 3) rates at `sample_ns`, for the velocity at a lever arm; of the attitude by default.
        depth: gives the vertical position; the velocity does without it.
    """
    lever = np.zeros(3) if lever_p_m is None else np.asarray(lever_p_m, dtype=np.float64)
    last_ns = int(sample_ns[-1])
    turned = attitudes.time_ns[(attitudes.time_ns > begin.time_ns) & (attitudes.time_ns < last_ns)]
    pinged = (velocities.time_ns >= begin.time_ns) & (velocities.time_ns <= last_ns)
    grid_ns = np.unique(np.concatenate([[begin.time_ns], turned, velocities.time_ns[pinged], sample_ns]))
    attitude_at = attitude_between(attitudes)
    started = attitude_at(np.array([begin.time_ns]))
    values, cov, since_ns = _held(velocities, begin, attitude_at, lever, pinged)

    step_s = np.diff(grid_ns) * 1e-9
    middle = attitude_at((grid_ns[:-1] + grid_ns[1:]) // 2)
    ping = np.searchsorted(since_ns, grid_ns[:-1], side="right") - 1
    moved_t_m = summed(middle.apply(values[ping]) * step_s[:, None])
    P = held_cov(grid_ns, middle.as_matrix(), cov, since_ns, ping, velocity_errors)
    P += velocity_errors.scale_sd**2 * outer(moved_t_m)
    P += attitude_cov(grid_ns, moved_t_m, attitude_errors, attitudes.time_ns)
    P += np.diag(np.square(begin.position_sd_m))

    rows = np.searchsorted(grid_ns, sample_ns)
    attitude = attitude_at(sample_ns)
    position = begin.position_t_m + moved_t_m[rows] + started.apply(lever) - attitude.apply(lever)
    position_cov = P[rows]
    if depth is not None:
        position, position_cov = _with_depth(position, position_cov, attitude, sample_ns, depth)
    latest = np.searchsorted(since_ns, sample_ns, side="right") - 1
    held_s = np.asarray((sample_ns - since_ns[latest]) * 1e-9, dtype=np.float64)
    velocity_cov = np.asarray(cov[latest] + velocity_errors.of_velocity(values[latest], held_s))
    rate = _rate(attitude_at, attitudes, sample_ns) if omega_p_radps is None else omega_p_radps
    return Reckoned(
        position_t_m=position,
        position_cov_m2=position_cov,
        velocity_p_mps=values[latest] - np.cross(rate, lever),
        velocity_cov_m2ps2=velocity_cov,
        attitude=attitude,
        attitude_sd_rad=attitude_errors.sd_rad,
    )


def attitude_between(attitudes: Attitudes) -> AttitudeAt:
    """Attitude at any times (n,), on the shortest way between two readings; the first and the last hold beyond them."""
    first_ns, last_ns = int(attitudes.time_ns[0]), int(attitudes.time_ns[-1])
    slerp = Slerp((attitudes.time_ns - first_ns) * 1e-9, attitudes.attitude)

    def at(time_ns: Times) -> Rotation:
        return slerp((np.clip(time_ns, first_ns, last_ns) - first_ns) * 1e-9)

    return at


def _held(
    velocities: Velocities, begin: Begin, attitude_at: AttitudeAt, lever: Floats, pinged: Flags
) -> tuple[Floats, Floats, Times]:
    """Velocities of the DVL's place, their covariances, and since when each is held; the start's is the first."""
    ends = attitude_at(np.array([begin.time_ns, begin.time_ns + RATE_NS]))
    omega = (ends[0].inv() * ends[1]).as_rotvec() / (RATE_NS * 1e-9)
    first = begin.velocity_p_mps + np.cross(omega, lever)
    values = np.concatenate([first[None], velocities.velocity_p_mps[pinged]])
    cov = np.concatenate([np.diag(np.square(begin.velocity_sd_mps))[None], velocities.cov_m2ps2[pinged]])
    since = np.concatenate([[begin.time_ns], velocities.time_ns[pinged]])
    # A ping at the very start replaces it.
    return (
        (values[1:], cov[1:], since[1:]) if len(since) > 1 and since[1] == since[0] else (values, cov, since)
    )


RATE_NS = 200_000_000
"""Time over which the angular rate is taken from the attitude, where a lever arm needs it."""


def _rate(attitude_at: AttitudeAt, attitudes: Attitudes, time_ns: Times) -> Floats:
    """(T, 3) angular rate against the tangent frame, platform axes, rad/s, from the attitude around each time."""
    half_ns = max(RATE_NS // 2, int(np.median(np.diff(attitudes.time_ns))))
    before, after = attitude_at(time_ns - half_ns), attitude_at(time_ns + half_ns)
    return np.asarray((before.inv() * after).as_rotvec() / (2e-9 * half_ns))


def _with_depth(
    position: Floats, cov: Floats, attitude: Rotation, sample_ns: Times, aid: DepthAid
) -> tuple[Floats, Floats]:
    """The vertical from the depth sensor: its reading less the sensor's place below the IMU."""
    position, cov = position.copy(), cov.copy()
    origin = sample_ns[0]
    read = np.interp((sample_ns - origin) * 1e-9, (aid.depths.time_ns - origin) * 1e-9, aid.depths.depth_m)
    position[:, 2] = read - attitude.apply(aid.lever_p_m)[:, 2]
    cov[:, 2, :], cov[:, :, 2] = 0.0, 0.0
    cov[:, 2, 2] = aid.sd_m**2
    return position, cov
