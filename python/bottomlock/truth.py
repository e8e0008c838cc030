"""The true motion that the sensors of a simulation are drawn from; and one over a level sea, laid on the ellipsoid.

Vehicles and analytic motions are made over a plane, with their velocity along north and east, their depth, and their
attitude against north, east and down. On the ellipsoid these are local: the depth is that below the ellipsoid, and a
constant heading follows a rhumb line. Hence, with local velocity v_n, radii M and N, and height h,

    dL/dt = v_N / (M + h),   dl/dt = v_E / ((N + h) cos L),

the attitude turns with the level axes, w_en = (v_E/(N+h), -v_N/(M+h), -v_E tan L/(N+h)), and a perfect IMU reads

    w_ip' = w_ip + dw + R' w_en,   f' = f + (2 dw + R' w_en) x v - R' (g(L, h) - g_0),

with dw = R' (w_ie(L) - w_ie(L_0)), all in the platform frame (Groves 2013, Eqs. 2.123, 5.44 and 5.54).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock import geodesy, kernel
from bottomlock.errors import DataError
from bottomlock.kernel import models

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """A true motion at the IMU's rate: values at the sample times, not means between them.

    Attributes:
        time_ns: (n,) int64, rising.
        position_t_m: (n, 3) tangent frame (north, east, down).
        attitude_t_p: (n, 4) unit quaternions, scalar first, platform to tangent.
        velocity_p_mps: (n, 3) velocity over ground, platform frame (forward, right, down).
        omega_p_radps: (n, 3) inertial angular rate: what a perfect gyro reads.
        force_p_mps2: (n, 3) specific force: what a perfect accelerometer reads.
        latitude_rad: geodetic latitude that the Earth rate belongs to.
        gravity_mps2: gravity that the specific force belongs to.
    """

    time_ns: NDArray[np.int64]
    position_t_m: Array
    attitude_t_p: Array
    velocity_p_mps: Array
    omega_p_radps: Array
    force_p_mps2: Array
    latitude_rad: float
    gravity_mps2: float

    def __post_init__(self) -> None:
        count = len(self.time_ns)
        if self.time_ns.dtype != np.int64 or self.time_ns.ndim != 1 or count < 2:
            raise DataError("truth time_ns must be a one-dimensional int64 array of at least 2 samples")
        steps = np.flatnonzero(np.diff(self.time_ns) <= 0)
        if steps.size:
            raise DataError(f"truth time_ns does not increase at row {steps[0] + 1}")
        for name, width in (
            ("position_t_m", 3), ("attitude_t_p", 4), ("velocity_p_mps", 3), ("omega_p_radps", 3), ("force_p_mps2", 3),
        ):  # fmt: skip
            values = getattr(self, name)
            if values.shape != (count, width):
                raise DataError(f"truth {name} has shape {values.shape}", expected=f"({count}, {width})")
            bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
            if bad.size:
                raise DataError(f"truth {name} is not finite at row {bad[0]}")
        norms = np.linalg.norm(self.attitude_t_p, axis=1)
        bad = np.flatnonzero(np.abs(norms - 1.0) > 1e-6)
        if bad.size:
            raise DataError(
                f"truth attitude_t_p has norm {norms[bad[0]]:.6g} at row {bad[0]}",
                expected="1 (scalar first)",
            )

    def kernel_arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays as the kernel takes them, contiguous and aligned; those of another process may be neither."""
        names = ("time_ns", "position_t_m", "attitude_t_p", "velocity_p_mps", "omega_p_radps", "force_p_mps2")
        return {name: np.require(getattr(self, name), requirements=["C", "A"]) for name in names}


def sample_times_ns(duration_s: float, rate_hz: float) -> NDArray[np.int64]:
    """Sample times from 0 to the duration, rounded to nanoseconds without drift."""
    count = math.floor(duration_s * rate_hz + 1e-9) + 1
    return np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)


PASSES = 6
"""Iterations of latitude and longitude over a block; each leaves a thousandth of what the one before left."""


class EllipsoidPath:
    """One vehicle's motion over a plane, block by block, as motion on the ellipsoid in the Earth-fixed tangent frame.

    Args:
        environment: latitude of the origin, gravity there, and the rate of the Earth.
    """

    def __init__(self, environment: models.Environment) -> None:
        self._environment = environment
        self._home = geodesy.Place(environment.latitude_rad, 0.0, 0.0)
        self._place = np.array([environment.latitude_rad, 0.0])
        self._before = np.zeros(3)

    def follow(self, block: dict[str, Array]) -> dict[str, Array]:
        """The arrays of `Truth` (n, ...) of the next block on the ellipsoid.

        Args:
            block: `position_t_m`, `attitude_t_p`, `velocity_p_mps`, `omega_p_radps` and `force_p_mps2` over a plane.
        """
        place = self._geodetic(block["position_t_m"])
        self._place, self._before = place[-1], block["position_t_m"][-1]
        latitude, longitude = place.T
        height = -block["position_t_m"][:, 2]
        position = geodesy.tangent_from_geodetic(latitude, longitude, height, self._home)
        here = kernel.local_earth(self._environment, position)
        to_tangent = Rotation.from_matrix(here["rotation_t_n"])
        to_level = Rotation.from_quat(block["attitude_t_p"][:, [1, 2, 3, 0]])
        velocity_p = block["velocity_p_mps"]
        velocity_n = to_level.apply(velocity_p)

        spin, origin = self._environment.earth_rate_radps, self._environment.latitude_rad
        faster = np.zeros_like(velocity_n)
        faster[:, 0] = spin * (np.cos(latitude) - np.cos(origin))
        faster[:, 2] = -spin * (np.sin(latitude) - np.sin(origin))
        meridian, transverse = geodesy.radii_m(latitude)
        east = velocity_n[:, 1] / (transverse + height)
        transport = np.stack(
            [east, -velocity_n[:, 0] / (meridian + height), -east * np.tan(latitude)], axis=1
        )
        heavier = to_tangent.inv().apply(here["gravity_t_mps2"])
        heavier[:, 2] -= self._environment.gravity_mps2

        earth_p, turn_p, fall_p = (to_level.inv().apply(part) for part in (faster, transport, heavier))
        return {
            "position_t_m": position,
            "attitude_t_p": np.ascontiguousarray((to_tangent * to_level).as_quat()[:, [3, 0, 1, 2]]),
            "velocity_p_mps": velocity_p,
            "omega_p_radps": block["omega_p_radps"] + earth_p + turn_p,
            "force_p_mps2": block["force_p_mps2"] + np.cross(2.0 * earth_p + turn_p, velocity_p) - fall_p,
        }

    def _geodetic(self, position_m: Array) -> Array:
        """(n, 2) latitude and longitude of positions over the plane, from the last one on, by the midpoint rule."""
        before = np.vstack([self._before, position_m])
        moved = np.diff(before, axis=0)
        height = -0.5 * (before[1:, 2] + before[:-1, 2])
        latitude = np.full(len(moved) + 1, self._place[0])
        for _ in range(PASSES):
            middle = 0.5 * (latitude[1:] + latitude[:-1])
            meridian, transverse = geodesy.radii_m(middle)
            latitude[1:] = self._place[0] + np.cumsum(moved[:, 0] / (meridian + height))
        turned = moved[:, 1] / ((transverse + height) * np.cos(middle))
        return np.stack([latitude[1:], self._place[1] + np.cumsum(turned)], axis=1)


def on_ellipsoid(truth: Truth, earth_rate_radps: float) -> Truth:
    """A truth over a plane, laid on the ellipsoid; gravity is that at its origin.

    Examples:
        >>> from bottomlock.simulation.manoeuvres import MANOEUVRES, manoeuvre_truth
        >>> flat = manoeuvre_truth(MANOEUVRES["yaw_turn"], rate_hz=10.0)
        >>> bool(np.abs(on_ellipsoid(flat, 0.0).position_t_m - flat.position_t_m).max() < 1e-2)
        True
    """
    environment = models.Environment(
        latitude_rad=truth.latitude_rad, gravity_mps2=truth.gravity_mps2, earth_rate_radps=earth_rate_radps
    )
    arrays = {name: array for name, array in truth.kernel_arrays().items() if name != "time_ns"}
    there = EllipsoidPath(environment).follow(arrays)
    return Truth(
        time_ns=truth.time_ns, latitude_rad=truth.latitude_rad, gravity_mps2=truth.gravity_mps2, **there
    )
