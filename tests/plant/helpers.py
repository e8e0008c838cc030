"""Ways to move a vehicle by hand: fixed fins and shaft, or the autopilot from a given state."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bottomlock.plant import AnyVehicle, Vehicle, load_vehicle
from bottomlock.plant.control import fin_mixing
from bottomlock.plant.equations import acceleration, to_tangent
from bottomlock.plant.maths import SCALAR, FloatArray

GRAVITY_MPS2 = 9.795
LATITUDE_RAD = math.radians(32.8)


def finned(name: str) -> Vehicle:
    """A packaged vehicle with fins."""
    vehicle = load_vehicle(name)
    assert isinstance(vehicle, Vehicle)
    return vehicle


def coast(
    vehicle: Vehicle,
    state: Sequence[float],
    *,
    fins_rad: Sequence[float] | FloatArray | Callable[[FloatArray], FloatArray],
    shaft_rps: float,
    duration_s: float,
) -> FloatArray:
    """Swim from a state (position, attitude, nu: 13) with fins held or set each step; states (n, 13)."""
    nu_dot = acceleration(vehicle, GRAVITY_MPS2, SCALAR)

    def rates(x: FloatArray, held: tuple[float, ...]) -> FloatArray:
        q0, q1, q2, q3, u, v, w, p, q, r = (float(value) for value in x[3:])
        accel = nu_dot((q0, q1, q2, q3), (u, v, w, p, q, r), (*held, shaft_rps), (0.0,) * 3, (0.0,) * 3)
        turn = 0.5 * np.array(
            [
                -q1 * p - q2 * q - q3 * r,
                q0 * p + q2 * r - q3 * q,
                q0 * q + q3 * p - q1 * r,
                q0 * r + q1 * q - q2 * p,
            ]
        )
        return np.concatenate([to_tangent(q0, q1, q2, q3, u, v, w), turn, accel])

    x, step_s = np.array(state, dtype=np.float64), 0.02
    track = [x]
    for _ in range(round(duration_s / step_s)):
        held = tuple(float(angle) for angle in (fins_rad(x) if callable(fins_rad) else fins_rad))
        k1 = rates(x, held)
        k2 = rates(x + 0.5 * step_s * k1, held)
        k3 = rates(x + 0.5 * step_s * k2, held)
        k4 = rates(x + step_s * k3, held)
        x = x + step_s / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        x[3:7] /= np.linalg.norm(x[3:7])
        track.append(x)
    return np.array(track)


LEVEL = (1.0, 0.0, 0.0, 0.0)
STILL = np.zeros(3)


def nu_dot(
    vehicle: AnyVehicle,
    nu: Sequence[float] | FloatArray,
    actuators: Sequence[float] | FloatArray,
    *,
    quaternion: Sequence[float] | FloatArray = LEVEL,
) -> FloatArray:
    """The acceleration (6,) of a vehicle in still water."""
    parts: Any = [
        np.asarray(part, dtype=np.float64).tolist() for part in (quaternion, nu, actuators, STILL, STILL)
    ]
    return np.array(acceleration(vehicle, GRAVITY_MPS2, SCALAR)(*parts))


def fins_of(
    vehicle: Vehicle, *, roll_rad: float = 0.0, pitch_rad: float = 0.0, yaw_rad: float = 0.0
) -> FloatArray:
    """Fin deflections of equivalent roll, pitch and yaw deflections."""
    return np.asarray(fin_mixing(vehicle) @ (roll_rad, pitch_rad, yaw_rad))


def at_speed(speed_mps: float) -> list[float]:
    """Level, northbound at 20 m, at a speed."""
    return [0.0, 0.0, 20.0, 1.0, 0.0, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0, 0.0, 0.0]
