"""Dead reckoning: the DVL's velocity, turned by a recorded attitude and summed up to a position.

No inertial reading is used and nothing is estimated, so this is the floor that a filter has to reach. The velocity of a
ping is held until the next ping that has a whole one. With C the attitude, p_d the place of the DVL and l its lever arm
from the IMU

    p_d(t) = p_d(0) + ∫ C v_d dt,    p(t) = p_d(t) − C(t) l

so the lever arm needs no angular rate. Where a depth sensor is there, it gives the vertical.

Source: Brokloff, "Matrix Algorithm for Doppler Sonar Navigation", OCEANS 1994.

Three kinds of error act on the way travelled. Of the attitude: an offset ρ turns the whole way, ρ × Δp; a first-order
walk has the covariance σ² exp(−|t − s|/τ) between two times, so that

    P = σ² Σᵢ Σⱼ φ^|i−j| aᵢ aⱼᵀ,   aᵢ = e × Δpᵢ,  φ = exp(−Δt/τ)

is summed up by a filter of first order over even steps; white errors are those of single readings. Of the DVL: noise of
a ping lasts until the next, a bias and a scale factor last for ever. And while no ping has a velocity the vehicle goes
on changing its own: its structure function D(h) = E(v(t + h) − v(t))² is measured on the log, and the integral of
v(t + s) − v(t) over s from 0 to h has the variance

    E(h) = h ∫₀ʰ D(s) ds − ∫₀ʰ (h − s) D(s) ds = ∫₀ʰ s D(s) ds

from E(v_s − v_0)(v_r − v_0) = (D(s) + D(r) − D(|s − r|))/2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from bottomlock.recordings.streams import Attitudes, Depths, Flags, Floats, Times

STEPS_OF_WALK = 20
"""Even steps in the time constant of the walk."""
MOST_STEPS = 20_000
LONG_HOLD = 2.0
"""Holds longer than this many usual intervals count as gaps; of the usual ones the change is made good by the next."""
FEWEST = 20
"""Whole velocities from which a structure function is measured."""


@dataclass(frozen=True)
class AttitudeErrors:
    """1 sigma of a recorded attitude about north, east, down, rad: offset, first-order walk, white; the walk's time.

    A reading holds for `white_held_s`, by default until the next one of the recording.
    """

    offset_sd_rad: Sequence[float] = (0.0, 0.0, 0.0)
    walk_sd_rad: Sequence[float] = (0.0, 0.0, 0.0)
    white_sd_rad: Sequence[float] = (0.0, 0.0, 0.0)
    walk_time_s: float = 3600.0
    white_held_s: float | None = None

    @property
    def sd_rad(self) -> Floats:
        """(3,) of a single reading."""
        parts = np.array([self.offset_sd_rad, self.walk_sd_rad, self.white_sd_rad])
        return np.asarray(np.sqrt((parts**2).sum(axis=0)))


@dataclass(frozen=True, eq=False)
class StructureFunction:
    """Mean square change (k, 3) of the velocity, m²/s², in platform axes over lags (k,) in s, which rise from 0."""

    lag_s: Floats
    change_m2ps2: Floats
    usual_s: float

    def __call__(self, lag_s: Floats) -> Floats:
        """(n, 3) at any lags; beyond the longest that was measured the last holds."""
        return np.stack([np.interp(lag_s, self.lag_s, self.change_m2ps2[:, k]) for k in range(3)], axis=-1)

    def of_position(self, held_s: Floats) -> Floats:
        """(n, 3) variance, m², of what the way lacks if a velocity was held for so long (E(h) above)."""
        longest = max(float(np.max(held_s, initial=0.0)), 1e-3)
        s = np.linspace(0.0, longest, 2001)
        rate = s[:, None] * self(s)
        E = np.concatenate(
            [np.zeros((1, 3)), np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0) * (s[1] - s[0])]
        )
        return np.stack([np.interp(held_s, s, E[:, k]) for k in range(3)], axis=-1)


@dataclass(frozen=True, eq=False)
class VelocityErrors:
    """Errors of the DVL's velocity beyond its noise: scale factor, bias (3, 3) in m²/s², and its change when held."""

    scale_sd: float
    bias_cov_m2ps2: Floats
    change: StructureFunction

    def of_velocity(self, velocity_p_mps: Floats, held_s: Floats) -> Floats:
        """(n, 3, 3) covariance of velocities that are held for `held_s` (n,)."""
        return (
            self.scale_sd**2 * outer(velocity_p_mps)
            + self.bias_cov_m2ps2
            + self.change(held_s)[:, :, None] * np.eye(3)
        )


def structure_function(
    time_ns: Times, velocity_p_mps: Floats, noise_var_m2ps2: Floats
) -> StructureFunction | None:
    """Of whole velocities (p, 3) at times (p,), less their noise (3,); None for too few of them."""
    count = len(time_ns)
    if count < FEWEST:
        return None
    lags = np.unique(np.geomspace(1, count // 2, 40).astype(np.int64))
    apart, change = [0.0], [np.zeros(3)]
    for lag in lags:
        apart.append(float(np.mean(time_ns[lag:] - time_ns[:-lag])) * 1e-9)
        square = np.mean((velocity_p_mps[lag:] - velocity_p_mps[:-lag]) ** 2, axis=0)
        change.append(np.maximum(square - 2.0 * noise_var_m2ps2, 0.0))
    usual_s = float(np.median(np.diff(time_ns))) * 1e-9
    return StructureFunction(np.array(apart), np.maximum.accumulate(np.array(change), axis=0), usual_s)


def white_noise(velocity_p_mps: Floats) -> Floats:
    """(3,) variance, m²/s², of what is white from one velocity (p, 3) to the next: half of D as its lag goes to 0."""
    first, second = (np.mean((velocity_p_mps[k:] - velocity_p_mps[:-k]) ** 2, axis=0) for k in (1, 2))
    return np.asarray(np.maximum(0.5 * np.minimum(2.0 * first - second, first), 0.0))


def summed(steps: Floats) -> Floats:
    """(n + 1, ...) running sum of (n, ...) from zero."""
    return np.concatenate([np.zeros((1, *steps.shape[1:])), np.cumsum(steps, axis=0)])


def outer(vectors: Floats) -> Floats:
    """(n, 3, 3) products of (n, 3) vectors with themselves."""
    return np.asarray(vectors[:, :, None] * vectors[:, None, :])


def held_cov(
    grid_ns: Times,
    attitude_t_p: Floats,
    cov_m2ps2: Floats,
    since_ns: Times,
    ping: Times,
    errors: VelocityErrors,
) -> Floats:
    """(n, 3, 3) covariance of the position from noise and bias of the velocities, and their change while held.

    Args:
        grid_ns: (n,) times.
        attitude_t_p: (n − 1, 3, 3) in the middle of each step.
        cov_m2ps2: (p, 3, 3) noise of each velocity, platform axes.
        since_ns: (p,) since when it is held.
        ping: (n − 1,) which of them is held in each step.
        errors: of all velocities.
    """
    step_s = np.asarray(np.diff(grid_ns) * 1e-9, dtype=np.float64)
    before_s = np.asarray((grid_ns[:-1] - since_ns[ping]) * 1e-9, dtype=np.float64)
    after_s = before_s + step_s
    C, Ct = attitude_t_p, np.swapaxes(attitude_t_p, 1, 2)
    # The noise of a velocity held for h moves the position by h times it: the steps of h² add up to that.
    noise = summed(C @ cov_m2ps2[ping] @ Ct * (after_s**2 - before_s**2)[:, None, None])
    turned = summed(C * step_s[:, None, None])
    bias = turned @ errors.bias_cov_m2ps2 @ np.swapaxes(turned, 1, 2)
    ends_ns = np.append(since_ns[1:], grid_ns[-1])
    of_position = errors.change.of_position
    gap = ((ends_ns - since_ns) * 1e-9 > LONG_HOLD * errors.change.usual_s)[ping]
    lacking = np.asarray(of_position(after_s) - of_position(before_s), dtype=np.float64)
    E = np.where(gap[:, None], lacking, 0.0)
    return np.asarray(noise + bias + summed((C * E[:, None, :]) @ Ct))


def attitude_cov(grid_ns: Times, moved_t_m: Floats, errors: AttitudeErrors, read_ns: Times) -> Floats:
    """(n, 3, 3) covariance of the position from errors of the attitude.

    Args:
        grid_ns: (n,) times.
        moved_t_m: (n, 3) way from the start.
        errors: 1 sigma about the tangent axes.
        read_ns: times of the attitude's readings.
    """
    seconds = (grid_ns - grid_ns[0]) * 1e-9
    least = min(errors.walk_time_s / STEPS_OF_WALK, 1.0)
    steps = int(np.clip(np.ceil(seconds[-1] / least), 1, MOST_STEPS))
    even = np.linspace(0.0, seconds[-1], steps + 1)
    step_s = even[1] - even[0]
    way = np.stack([np.interp(even, seconds, moved_t_m[:, k]) for k in range(3)], axis=1)
    fade = float(np.exp(-step_s / errors.walk_time_s))
    reading_s = errors.white_held_s or float(np.median(np.diff(read_ns))) * 1e-9
    P = np.zeros((steps + 1, 3, 3))
    for k, axis in enumerate(np.eye(3)):
        whole = np.cross(axis, way)
        a = np.diff(whole, axis=0)
        P += errors.offset_sd_rad[k] ** 2 * outer(whole)
        correlated = lfilter([1.0], [1.0, -fade], a, axis=0)
        both = a[:, :, None] * correlated[:, None, :]
        P += errors.walk_sd_rad[k] ** 2 * summed(both + np.swapaxes(both, 1, 2) - outer(a))
        # A step holds step_s / reading_s independent readings, each of which turns its part of it.
        P += errors.white_sd_rad[k] ** 2 * summed(outer(a)) * (reading_s / step_s)
    flat = P.reshape(steps + 1, 9)
    return np.stack([np.interp(seconds, even, flat[:, k]) for k in range(9)], axis=1).reshape(-1, 3, 3)


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
    started = attitudes.at(np.array([begin.time_ns]))
    values, cov, since_ns = _held(velocities, begin, attitudes, lever, pinged)

    step_s = np.diff(grid_ns) * 1e-9
    middle = attitudes.at((grid_ns[:-1] + grid_ns[1:]) // 2)
    ping = np.searchsorted(since_ns, grid_ns[:-1], side="right") - 1
    moved_t_m = summed(middle.apply(values[ping]) * step_s[:, None])
    P = held_cov(grid_ns, middle.as_matrix(), cov, since_ns, ping, velocity_errors)
    P += velocity_errors.scale_sd**2 * outer(moved_t_m)
    P += attitude_cov(grid_ns, moved_t_m, attitude_errors, attitudes.time_ns)
    P += np.diag(np.square(begin.position_sd_m))

    rows = np.searchsorted(grid_ns, sample_ns)
    attitude = attitudes.at(sample_ns)
    position = begin.position_t_m + moved_t_m[rows] + started.apply(lever) - attitude.apply(lever)
    position_cov = P[rows]
    if depth is not None:
        position, position_cov = _with_depth(position, position_cov, attitude, sample_ns, depth)
    latest = np.searchsorted(since_ns, sample_ns, side="right") - 1
    held_s = np.asarray((sample_ns - since_ns[latest]) * 1e-9, dtype=np.float64)
    velocity_cov = np.asarray(cov[latest] + velocity_errors.of_velocity(values[latest], held_s))
    rate = _rate(attitudes, sample_ns) if omega_p_radps is None else omega_p_radps
    return Reckoned(
        position_t_m=position,
        position_cov_m2=position_cov,
        velocity_p_mps=values[latest] - np.cross(rate, lever),
        velocity_cov_m2ps2=velocity_cov,
        attitude=attitude,
        attitude_sd_rad=attitude_errors.sd_rad,
    )


def _held(
    velocities: Velocities, begin: Begin, attitudes: Attitudes, lever: Floats, pinged: Flags
) -> tuple[Floats, Floats, Times]:
    """Velocities of the DVL's place, their covariances, and since when each is held; the start's is the first."""
    ends = attitudes.at(np.array([begin.time_ns, begin.time_ns + RATE_NS]))
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


def _rate(attitudes: Attitudes, time_ns: Times) -> Floats:
    """(T, 3) angular rate against the tangent frame, platform axes, rad/s, from the attitude around each time."""
    half_ns = max(RATE_NS // 2, int(np.median(np.diff(attitudes.time_ns))))
    before, after = attitudes.at(time_ns - half_ns), attitudes.at(time_ns + half_ns)
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
