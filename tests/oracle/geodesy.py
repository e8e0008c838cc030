"""WGS 84 by the book: geodetic to Earth-centred coordinates, and back by iteration; a tangent plane by its axes."""

import numpy as np

from tests.oracle.rotations import Array

A, F = 6_378_137.0, 1.0 / 298.257223563
E2 = F * (2.0 - F)


def ecef(latitude: float, longitude: float, height: float) -> Array:
    """Earth-centred, Earth-fixed coordinates, m."""
    n = A / np.sqrt(1.0 - E2 * np.sin(latitude) ** 2)
    return np.array(
        [
            (n + height) * np.cos(latitude) * np.cos(longitude),
            (n + height) * np.cos(latitude) * np.sin(longitude),
            (n * (1.0 - E2) + height) * np.sin(latitude),
        ]
    )


def axes(latitude: float, longitude: float) -> Array:
    """North, east and down as rows."""
    sp, cp, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    return np.array([[-sp * cl, -sp * sl, cp], [-sl, cl, 0.0], [-cp * cl, -cp * sl, -sp]])


def geodetic(point: Array) -> tuple[float, float, float]:
    """Latitude, longitude (rad) and height (m), by fixed-point iteration."""
    x, y, z = point
    p = np.hypot(x, y)
    latitude, height = np.arctan2(z, p * (1.0 - E2)), 0.0
    for _ in range(20):
        n = A / np.sqrt(1.0 - E2 * np.sin(latitude) ** 2)
        height = p / np.cos(latitude) - n
        latitude = np.arctan2(z, p * (1.0 - E2 * n / (n + height)))
    return float(latitude), float(np.arctan2(y, x)), float(height)


def geodetic_of_ned(
    ned: Array, home: Array, latitude_deg: float, longitude_deg: float
) -> tuple[float, float, float]:
    """Latitude, longitude (rad) and height (m) of a point in the tangent plane of a place."""
    return geodetic(home + axes(np.deg2rad(latitude_deg), np.deg2rad(longitude_deg)).T @ ned)
