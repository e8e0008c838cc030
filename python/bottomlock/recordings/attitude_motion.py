"""Inertial readings of a vehicle that has none: from its attitude, and a velocity that persists along its own axes.

Used by a replay and live alike. The derivation is in docs/no_imu.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bottomlock.kernel import EARTH_RATE_RADPS
from bottomlock.libraries import transform
from bottomlock.recordings.streams import Attitudes, Floats, Times

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

LONGEST_STEP_S = 0.1
"""Intervals between attitudes are divided into equal steps of at most this: the covariance is propagated as often."""


class Readings(NamedTuple):
    """Inertial readings (n, 3), platform axes, each the mean over the step that ends at it."""

    omega_p_radps: Floats
    force_p_mps2: Floats


def divided(
    time_ns: Times,
    attitude: Rotation,
    *,
    longest_step_s: float = LONGEST_STEP_S,
    longest_interval_s: float = np.inf,
) -> tuple[Times, Rotation]:
    """Attitudes (m,) at the given times and, between them, at equal steps of a constant rate.

    Args:
        time_ns: (n,) rising times.
        attitude: (n,) rotations from platform to tangent frame.
        longest_step_s: longest step, s.
        longest_interval_s: longer intervals, s, stay whole.
    """
    step_ns = np.diff(time_ns)
    parts = np.maximum(np.ceil(step_ns * 1e-9 / longest_step_s).astype(np.int64), 1)
    parts[step_ns * 1e-9 > longest_interval_s] = 1
    if (parts == 1).all():
        return time_ns, attitude
    first = np.repeat(np.arange(len(parts)), parts)
    begun = np.concatenate([[0], np.cumsum(parts)[:-1]])
    share = (np.arange(parts.sum()) - begun[first]) / parts[first]
    inner = time_ns[first] + np.round(share * step_ns[first]).astype(np.int64)
    times = np.concatenate([inner, time_ns[-1:]])
    return times, Attitudes(time_ns, attitude).at(times)


def inertial_readings(
    time_ns: Times, attitude: Rotation, held_velocity_p_mps: Floats, *, latitude_rad: float
) -> Readings:
    """Rates and specific forces, without gravity, under which a velocity persists along the platform's axes.

    With them the strapdown step reproduces the attitudes, and takes a velocity v before each step to v after it.

    Args:
        time_ns: (n,) rising times, two or more.
        attitude: (n,) rotations from platform to tangent frame.
        held_velocity_p_mps: (n, 3) v over the step that ends at each time; the first is not used.
        latitude_rad: for the Earth's rate.

    Returns:
        (n, 3) each; the first reading, before which there is no step, is the second again.
    """
    dt_s = (np.diff(time_ns) * 1e-9)[:, None]
    earth_t = EARTH_RATE_RADPS * np.array([np.cos(latitude_rad), 0.0, -np.sin(latitude_rad)])
    before, after = attitude[:-1], attitude[1:]
    omega = (before.inv() * transform.Rotation.from_rotvec(earth_t * dt_s) * after).as_rotvec() / dt_s
    turn = (before.inv() * after).as_rotvec()
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    # The trapezium of R f over the step is R₂v − R₁v for f = (2/Δt) tan(θ/2) u × v.
    swing = np.where(angle > 1e-9, 2.0 * np.tan(0.5 * angle) / np.maximum(angle, 1e-9), 1.0) * turn / dt_s
    coriolis = 2.0 * (before * transform.Rotation.from_rotvec(0.5 * turn)).inv().apply(earth_t)
    force = np.cross(swing + coriolis, held_velocity_p_mps[1:])
    return Readings(np.concatenate([omega[:1], omega]), np.concatenate([force[:1], force]))


def held(time_ns: Times, pinged_ns: Times, velocity_p_mps: Floats) -> Floats:
    """(n, 3) the velocity of the last ping before each time's step, 0 before the first.

    Args:
        time_ns: (n,) ends of the steps.
        pinged_ns: (p,) rising times of pings that determine the whole velocity.
        velocity_p_mps: (p, 3) platform axes.
    """
    begun = np.concatenate([time_ns[:1], time_ns[:-1]])
    row = np.searchsorted(pinged_ns, begun, side="right")
    return np.concatenate([np.zeros((1, 3)), velocity_p_mps])[row]


class MotionFromAttitude:
    """Attitudes of a vehicle as they come, turned into inertial readings for a `Navigator`.

    The navigator's model has `environment.gravity_mps2 = 0`, its options `imu_sampling = "averaged"`, and its initial
    attitude is that of the first call.

    Args:
        latitude_rad: for the Earth's rate.
        longest_interval_s: a longer interval between attitudes, s, stays one step: for the navigator it is a gap.
    """

    def __init__(self, latitude_rad: float, *, longest_interval_s: float = 1.0) -> None:
        self._latitude_rad, self._longest_interval_s = latitude_rad, longest_interval_s
        self._velocity: Floats = np.zeros(3)
        self._last: tuple[int, Rotation] | None = None

    def hold(self, velocity_p_mps: ArrayLike) -> None:
        """The velocity (3,) of a complete ping, platform axes, m/s: it persists from the next attitude on."""
        self._velocity = np.asarray(velocity_p_mps, dtype=np.float64)

    def block(self, time_ns: int, attitude_t_p: ArrayLike) -> dict[str, Any]:
        """The readings since the attitude before, for `Navigator.push_imu_block(**block)`; none at the first.

        Args:
            time_ns: later than the one before.
            attitude_t_p: (4,) quaternion, scalar first, platform to tangent.
        """
        now = transform.Rotation.from_quat(np.roll(np.asarray(attitude_t_p, dtype=np.float64), -1))
        last, self._last = self._last, (time_ns, now)
        if last is None:
            none = np.zeros((0, 3))
            return {"time_ns": np.zeros(0, dtype=np.int64), "omega_p_radps": none, "force_p_mps2": none}
        times, attitude = divided(
            np.array([last[0], time_ns]),
            transform.Rotation.concatenate([last[1], now]),
            longest_interval_s=self._longest_interval_s,
        )
        velocity = np.tile(self._velocity, (len(times), 1))
        readings = inertial_readings(times, attitude, velocity, latitude_rad=self._latitude_rad)
        return {"time_ns": times[1:]} | {key: values[1:] for key, values in readings._asdict().items()}
