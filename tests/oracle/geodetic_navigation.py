"""Inertial navigation in geodetic coordinates, with transport rate (Groves 2013, sect. 5.4), slow and by the book.

State: latitude L, longitude l, height h, velocity v_n over north, east, down, and the rotation C from platform to those
axes, which turn with the vehicle:

    dL/dt = v_N / (M + h),  dl/dt = v_E / ((N + h) cos L),  dh/dt = -v_D,
    dv_n/dt = C f + g(L, h) - (w_en + 2 w_ie) x v_n,
    dC/dt = C [w_ip x] - [(w_ie + w_en) x] C,

integrated by Runge and Kutta's method of fourth order. No tangent frame, no quaternion, none of the package's geodesy.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.oracle.geodesy import E2, A
from tests.oracle.gravity import somigliana
from tests.oracle.rotations import Array

EARTH_RATE = 7.292115e-5
WATER_GRADIENT = 2.226e-6


@dataclass(frozen=True)
class Navigated:
    """Latitude, longitude (rad), height (m), velocity north, east, down (m/s), rotation to those axes (3, 3)."""

    latitude: float
    longitude: float
    height: float
    velocity_n: Array
    rotation_n_p: Array


def radii(latitude: float) -> tuple[float, float]:
    """Meridian and transverse radius of curvature, m."""
    root = 1.0 - E2 * np.sin(latitude) ** 2
    return A * (1.0 - E2) / root**1.5, A / np.sqrt(root)


def earth_rate_n(latitude: float) -> Array:
    """Rate of the Earth over north, east, down, rad/s."""
    return EARTH_RATE * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])


def transport_rate_n(latitude: float, height: float, velocity_n: Array) -> Array:
    """How the level axes turn as the vehicle moves, rad/s (Groves 2013, Eq. 5.44)."""
    meridian, transverse = radii(latitude)
    east = velocity_n[1] / (transverse + height)
    return np.array([east, -velocity_n[0] / (meridian + height), -east * np.tan(latitude)])


def navigate(
    start: Navigated, inertial: Callable[[float], tuple[Array, Array]], duration_s: float, step_s: float
) -> Navigated:
    """The state after a duration; `inertial` gives the inertial rate and the specific force (platform) at a time."""

    def rate(time_s: float, state: Array) -> Array:
        latitude, _, height = state[:3]
        velocity, rotation = state[3:6], state[6:].reshape(3, 3)
        omega, force = inertial(time_s)
        earth, transport = earth_rate_n(latitude), transport_rate_n(latitude, height, velocity)
        meridian, transverse = radii(latitude)
        gravity = np.array([0.0, 0.0, somigliana(latitude) - WATER_GRADIENT * height])
        acceleration = rotation @ force + gravity - np.cross(transport + 2.0 * earth, velocity)
        turn = rotation @ _cross(omega) - _cross(earth + transport) @ rotation
        place = [
            velocity[0] / (meridian + height),
            velocity[1] / ((transverse + height) * np.cos(latitude)),
            -velocity[2],
        ]
        return np.concatenate([place, acceleration, turn.ravel()])

    state = np.concatenate(
        [[start.latitude, start.longitude, start.height], start.velocity_n, start.rotation_n_p.ravel()]
    )
    for k in range(round(duration_s / step_s)):
        t = k * step_s
        first = rate(t, state)
        second = rate(t + 0.5 * step_s, state + 0.5 * step_s * first)
        third = rate(t + 0.5 * step_s, state + 0.5 * step_s * second)
        last = rate(t + step_s, state + step_s * third)
        state = state + step_s / 6.0 * (first + 2.0 * second + 2.0 * third + last)
    left, _, right = np.linalg.svd(state[6:].reshape(3, 3))
    return Navigated(state[0], state[1], state[2], state[3:6], left @ right)


def _cross(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
