"""A motion over a level sea, laid on the ellipsoid.

Vehicles and analytic motions are made over a plane, with their velocity along north and east, their depth, and their
attitude against north, east and down. On the ellipsoid these are local: the depth is that below the ellipsoid, and a
constant heading follows a rhumb line. Hence, with local velocity v_n, radii M and N, and height h,

    dL/dt = v_N / (M + h),   dl/dt = v_E / ((N + h) cos L),

the attitude turns with the level axes, w_en = (v_E/(N+h), -v_N/(M+h), -v_E tan L/(N+h)), and a perfect IMU reads

    w_ip' = w_ip + dw + R' w_en,   f' = f + (2 dw + R' w_en) x v - R' (g(L, h) - g_0),

with dw = R' (w_ie(L) - w_ie(L_0)), all in the platform frame (Groves 2013, Eqs. 2.123, 5.44 and 5.54).
"""

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock import kernel
from bottomlock.kernel import models
from bottomlock.recordings import geodesy
from bottomlock.truth.truth import Array, Truth

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
        >>> from bottomlock.truth.manoeuvres import MANOEUVRES, manoeuvre_truth
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
