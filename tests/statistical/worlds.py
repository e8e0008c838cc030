"""Worlds drawn from what the method sway_current assumes: current, sway gain, trim and slip differ from run to run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline

from tests import dive
from tests.oracle.mechanisation import earth_rate_tangent
from tests.oracle.rotations import Array

GRAVITY_MPS2 = 9.8
LATITUDE_RAD = 0.5725
SECONDS = 250
RATE_HZ = 50.0
SPEED_MPS = 2.0

Yaw = Callable[[Array], tuple[Array, Array, Array]]
Course = Callable[[Array, int], Array]


def constant(value: float) -> Course:
    """The same at all times."""
    return lambda t, order: np.full_like(t, value if order == 0 else 0.0)


def straight(t: Array) -> tuple[Array, Array, Array]:
    """Yaw, its rate and its acceleration: none."""
    return np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)


def figure_eight(t: Array) -> tuple[Array, Array, Array]:
    """Yaw swings ±2.4 rad with a period of 125 s: turning nearly all the time."""
    w = 2 * np.pi / 125
    return 2.4 * np.cos(w * t) - 2.4, -2.4 * w * np.sin(w * t), -2.4 * w**2 * np.cos(w * t)


def lawn_mower(t: Array) -> tuple[Array, Array, Array]:
    """Legs of 40 s and half turns of 20 s, to starboard and to port by turns, smooth at both ends."""
    yaw, rate, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for number, start in enumerate(range(40, SECONDS, 60)):
        part = np.clip((t - start) / 20, 0, 1)
        side = (-1) ** number * np.pi / 20
        yaw += side * 20 * (part - np.sin(2 * np.pi * part) / (2 * np.pi))
        rate += side * (1 - np.cos(2 * np.pi * part))
        acceleration += side * 2 * np.pi / 20 * np.sin(2 * np.pi * part)
    return yaw, rate, acceleration


def gauss_markov(rng: np.random.Generator, sd: float, time_s: float, seconds: int = SECONDS) -> CubicSpline:
    """A sample at 5 Hz, drawn in the long run's spread, smooth in between so that it is a possible motion."""
    step_s = 0.2
    t = np.arange(0, seconds + step_s, step_s)
    drawn = rng.normal(size=len(t)) * sd
    drawn[0] = rng.normal() * sd
    return CubicSpline(t, dive.gauss_markov(drawn, step_s, time_s))


def draw(rng: np.random.Generator, prior: Mapping[str, float], yaw: Yaw) -> dict[str, Any]:
    """The arrays of a truth: 2 m/s ahead through the water, level; sway and heave as the prior has them."""
    current = [gauss_markov(rng, prior["current_sd_mps"], prior["current_time_s"]) for _ in range(2)]
    trim = gauss_markov(rng, prior["trim_sd_mps"], prior["trim_time_s"])
    sway, heave = (gauss_markov(rng, prior["slip_sd_mps"], prior["slip_time_s"]) for _ in range(2))
    gain = prior["sway_gain_m"] + rng.normal() * prior["sway_gain_sd_m"]
    return truth(
        SECONDS, yaw, current, Motion(lambda t, order: np.full_like(t, SPEED_MPS if order == 0 else 0.0),
        sway, lambda t, order: trim(t, order) + heave(t, order), gain),
    )  # fmt: skip


@dataclass(frozen=True)
class Motion:
    """Velocity through the water, m/s, by times and order of the derivative; sway has `gain` times yaw rate less."""

    surge: Course
    sway: Course
    heave: Course
    gain: float = 0.0


def truth(seconds: int, yaw: Yaw, current: Sequence[Course], motion: Motion) -> dict[str, Any]:
    """The arrays of a level vehicle's truth at 50 Hz; `current` along north and east."""
    time_ns = np.round(np.arange(int(seconds * RATE_HZ) + 1) * 1e9 / RATE_HZ).astype(np.int64)
    t = time_ns * 1e-9
    psi, rate, acceleration = yaw(t)
    north, east = current
    sway, heave, gain = motion.sway, motion.heave, motion.gain

    c, s = np.cos(psi), np.sin(psi)
    ahead, across = c * north(t, 0) + s * east(t, 0), c * east(t, 0) - s * north(t, 0)
    surge = motion.surge(t, 0)
    velocity = np.stack([surge + ahead, across - gain * rate + sway(t, 0), heave(t, 0)], axis=-1)
    change = np.stack(
        [
            motion.surge(t, 1) + rate * across + c * north(t, 1) + s * east(t, 1),
            -rate * ahead + c * east(t, 1) - s * north(t, 1) - gain * acceleration + sway(t, 1),
            heave(t, 1),
        ],
        axis=-1,
    )
    zero, one = np.zeros_like(t), np.ones_like(t)
    rotation = np.stack(
        [np.stack(row, axis=-1) for row in ([c, -s, zero], [s, c, zero], [zero, zero, one])], axis=1
    )
    earth_p = np.einsum("tij,i->tj", rotation, earth_rate_tangent(LATITUDE_RAD))
    omega = np.stack([zero, zero, rate], axis=-1) + earth_p
    # v̇ = f + Rᵀg − (ω_ip + Rᵀω_ie) × v, level.
    force = change + np.cross(omega + earth_p, velocity) - np.array([0.0, 0.0, GRAVITY_MPS2])
    velocity_t = np.einsum("tij,tj->ti", rotation, velocity)
    return {
        "time_ns": time_ns,
        "position_t_m": cumulative_simpson(velocity_t, x=t, axis=0, initial=0),
        "attitude_t_p": np.stack([np.cos(psi / 2), zero, zero, np.sin(psi / 2)], axis=-1),
        "velocity_p_mps": velocity,
        "omega_p_radps": omega,
        "force_p_mps2": force,
    }
