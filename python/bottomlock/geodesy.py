"""Geodetic coordinates (WGS 84) to the tangent frame and back."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

SEMI_MAJOR_AXIS_M = 6_378_137.0
FLATTENING = 1.0 / 298.257223563
"""Defining constants of WGS 84 (NIMA TR8350.2, 3rd edition, Table 3.1)."""
SEMI_MINOR_AXIS_M = SEMI_MAJOR_AXIS_M * (1.0 - FLATTENING)
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
PASSES = 4
"""Iterations of the latitude: the first leaves less than 1e-9 rad near the surface, each further one far less."""


@dataclass(frozen=True)
class Place:
    """Origin of a tangent frame (WGS 84): latitude and longitude, rad, height above the ellipsoid, m."""

    latitude_rad: float
    longitude_rad: float
    height_m: float


def radii_m(latitude_rad: Floats) -> tuple[Floats, Floats]:
    """Radii of curvature of the ellipsoid, m, along the meridian and across it (Groves 2013, Eqs. 2.105 and 2.106)."""
    root = np.sqrt(1.0 - ECCENTRICITY_SQUARED * np.sin(latitude_rad) ** 2)
    transverse = SEMI_MAJOR_AXIS_M / root
    return np.asarray((1.0 - ECCENTRICITY_SQUARED) * transverse / root**2), np.asarray(transverse)


def _earth_fixed(latitude_rad: Floats, longitude_rad: Floats, height_m: Floats) -> Floats:
    """(..., 3) Earth-centred, Earth-fixed positions, m (Groves 2013, Eq. 2.112)."""
    sin, cos = np.sin(latitude_rad), np.cos(latitude_rad)
    _, transverse_radius = radii_m(latitude_rad)
    return np.stack(
        [
            (transverse_radius + height_m) * cos * np.cos(longitude_rad),
            (transverse_radius + height_m) * cos * np.sin(longitude_rad),
            ((1.0 - ECCENTRICITY_SQUARED) * transverse_radius + height_m) * sin,
        ],
        axis=-1,
    )


def _tangent_from_earth(at: Place) -> Floats:
    """(3, 3) rotation from Earth-fixed axes to north, east, down at a place (Groves 2013, Eq. 2.150)."""
    sin, cos = np.sin(at.latitude_rad), np.cos(at.latitude_rad)
    east_sin, east_cos = np.sin(at.longitude_rad), np.cos(at.longitude_rad)
    return np.array(
        [
            [-sin * east_cos, -sin * east_sin, cos],
            [-east_sin, east_cos, 0.0],
            [-cos * east_cos, -cos * east_sin, -sin],
        ]
    )


def _origin(at: Place) -> Floats:
    return _earth_fixed(np.asarray(at.latitude_rad), np.asarray(at.longitude_rad), np.asarray(at.height_m))


def tangent_from_geodetic(
    latitude_rad: ArrayLike, longitude_rad: ArrayLike, height_m: ArrayLike, at: Place
) -> Floats:
    """(n, 3) north, east, down, m, in the tangent frame with its origin at `at`; a row has the bits that it has alone.

    Examples:
        A minute of latitude is a nautical mile, and the Earth curves away below the tangent plane:

        >>> home = Place(np.deg2rad(45.0), 0.0, 0.0)
        >>> tangent_from_geodetic([np.deg2rad(45.0 + 1.0 / 60.0)], [0.0], [0.0], home).round(1).tolist()
        [[1852.2, 0.0, 0.3]]
    """
    latitude, longitude, height = np.broadcast_arrays(
        *(np.asarray(part, dtype=np.float64) for part in (latitude_rad, longitude_rad, height_m))
    )
    away = np.asarray(_earth_fixed(latitude, longitude, height) - _origin(at))
    # A product of two rows or more: that of a single one rounds in another order.
    rows = away.reshape(-1, 3)
    tangent = (np.repeat(rows, 2, axis=0) if len(rows) == 1 else rows) @ _tangent_from_earth(at).T
    return np.asarray(tangent[: len(rows)].reshape(away.shape))


def geodetic_from_tangent(position_t_m: ArrayLike, at: Place) -> tuple[Floats, Floats, Floats]:
    """Latitude (rad), longitude (rad) and height (m) of (n, 3) positions in the tangent frame with its origin at `at`.

    The latitude is iterated by its reduced latitude (Bowring 1976).
    """
    position = _origin(at) + np.asarray(position_t_m, dtype=np.float64) @ _tangent_from_earth(at)
    x, y, z = np.moveaxis(position, -1, 0)
    distance = np.hypot(x, y)
    second = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
    reduced = np.arctan2(SEMI_MAJOR_AXIS_M * z, SEMI_MINOR_AXIS_M * distance)
    for _ in range(PASSES):
        latitude = np.arctan2(
            z + second * SEMI_MINOR_AXIS_M * np.sin(reduced) ** 3,
            distance - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS_M * np.cos(reduced) ** 3,
        )
        reduced = np.arctan2(SEMI_MINOR_AXIS_M * np.sin(latitude), SEMI_MAJOR_AXIS_M * np.cos(latitude))
    sin, cos = np.sin(latitude), np.cos(latitude)
    # The projection on the normal has no singularity at the pole, unlike the distance over the cosine.
    height = distance * cos + z * sin - SEMI_MAJOR_AXIS_M * np.sqrt(1.0 - ECCENTRICITY_SQUARED * sin**2)
    return np.asarray(latitude), np.asarray(np.arctan2(y, x)), np.asarray(height)
