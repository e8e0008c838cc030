"""What dead reckoning may claim: errors of the attitude and of the velocity, carried to a covariance of the position.

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

from bottomlock.recordings.streams import Floats, Times

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
