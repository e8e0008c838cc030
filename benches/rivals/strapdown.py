"""One strapdown for every rival: attitude, velocity and position in the tangent frame over a stretch of samples.

    Ṙ = R [ω_ip ×] − [ω_ie ×] R,  v̇ = R f + g − 2 ω_ie × v,  ṗ = v

with v in tangent axes; docs/conventions.md has the same motion in platform axes. Any leading axes: one state, the
sigma points of a filter, or many runs.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benches.rivals import rotations
from benches.rivals.timeline import Stretch
from bottomlock.kernel.models import Environment

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Earth:
    """Rate of the Earth (3,), rad/s, and gravity (3,), m/s², in tangent axes."""

    rate_t_radps: Floats
    gravity_t_mps2: Floats

    @classmethod
    def of(cls, environment: Environment) -> "Earth":
        """At the latitude of a model."""
        latitude = environment.latitude_rad
        rate = environment.earth_rate_radps * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
        return cls(rate, np.array([0.0, 0.0, environment.gravity_mps2]))


@dataclass(frozen=True, eq=False)
class Motion:
    """Attitude (..., 3, 3) platform to tangent, velocity and position in tangent axes (..., 3)."""

    rotation: Floats
    velocity_t_mps: Floats
    position_t_m: Floats


@dataclass(frozen=True, eq=False)
class Increment:
    """What the specific force added to velocity and position (..., 3), and ∫ R dt (..., 3, 3), in tangent axes."""

    velocity_t_mps: Floats
    position_t_m: Floats
    rotation_s: Floats


def advance(
    motion: Motion, stretch: Stretch, earth: Earth, *, accel_bias: Floats, gyro_bias: Floats
) -> tuple[Motion, Increment]:
    """The motion at the end of a stretch, with biases (..., 3) taken from the samples."""
    step = stretch.step_s
    duration = stretch.duration_s
    turned = (stretch.omega_p_radps - gyro_bias[..., None, :]) * step[:, None]
    half, whole = rotations.exp(0.5 * turned), rotations.exp(turned)
    # Of the platform at the start: the attitude in the middle of every step, and at its end.
    middle: Floats = np.empty_like(half)
    attitude = np.broadcast_to(np.eye(3), half[..., 0, :, :].shape)
    for k in range(len(step)):
        middle[..., k, :, :] = attitude @ half[..., k, :, :]
        attitude = attitude @ whole[..., k, :, :]
    force = stretch.force_p_mps2 - accel_bias[..., None, :]
    gained = (middle @ force[..., None])[..., 0] * step[:, None]
    # The velocity gained by the start of a step acts over all of it, that gained in it over half of it.
    remaining = duration - np.cumsum(step) + 0.5 * step
    # The tangent frame turns with the Earth meanwhile.
    halfway = rotations.exp(-0.5 * duration * earth.rate_t_radps) @ motion.rotation
    increment = Increment(
        velocity_t_mps=_apply(halfway, gained.sum(axis=-2)),
        position_t_m=_apply(halfway, (gained * remaining[:, None]).sum(axis=-2)),
        rotation_s=halfway @ (middle * step[:, None, None]).sum(axis=-3),
    )
    velocity, gravity = motion.velocity_t_mps, earth.gravity_t_mps2
    coriolis = -2.0 * _apply(
        rotations.skew(earth.rate_t_radps),
        velocity + 0.5 * (increment.velocity_t_mps + gravity * duration),
    )
    after = velocity + increment.velocity_t_mps + (gravity + coriolis) * duration
    position = (
        motion.position_t_m
        + velocity * duration
        + increment.position_t_m
        + 0.5 * (gravity + coriolis) * duration**2
    )
    turned_earth = rotations.exp(-duration * earth.rate_t_radps)
    return Motion(turned_earth @ motion.rotation @ attitude, after, position), increment


def _apply(matrix: Floats, vector: Floats) -> Floats:
    out: Floats = (matrix @ vector[..., None])[..., 0]
    return out
