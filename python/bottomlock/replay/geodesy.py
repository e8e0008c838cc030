"""Geodetic coordinates (WGS 84) to the tangent frame and back, by pymap3d."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.errors import DataError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """Origin of a tangent frame (WGS 84): latitude and longitude, rad, height above the ellipsoid, m."""

    latitude_rad: float
    longitude_rad: float
    height_m: float


def _pymap3d() -> Any:  # noqa: ANN401 - an extra, imported when positions are geodetic
    try:
        import pymap3d  # noqa: PLC0415
    except ImportError as error:
        raise DataError(
            "latitude and longitude need the package pymap3d: python -m pip install 'bottomlock[geodesy]'"
        ) from error
    return pymap3d


def tangent_from_geodetic(
    latitude_rad: ArrayLike, longitude_rad: ArrayLike, height_m: ArrayLike, at: Place
) -> Floats:
    """(n, 3) north, east, down, m, in the tangent frame with its origin at `at`.

    Raises:
        DataError: where pymap3d is not installed.

    Examples:
        A minute of latitude is a nautical mile, and the Earth curves away below the tangent plane:

        >>> home = Place(np.deg2rad(45.0), 0.0, 0.0)
        >>> tangent_from_geodetic([np.deg2rad(45.0 + 1.0 / 60.0)], [0.0], [0.0], home).round(1).tolist()
        [[1852.2, 0.0, 0.3]]
    """
    latitude, longitude, height = np.broadcast_arrays(
        *(np.asarray(part, dtype=np.float64) for part in (latitude_rad, longitude_rad, height_m))
    )
    parts = _pymap3d().geodetic2ned(
        latitude, longitude, height, at.latitude_rad, at.longitude_rad, at.height_m, deg=False
    )
    return np.stack([np.asarray(part, dtype=np.float64) for part in parts], axis=-1)


def geodetic_from_tangent(position_t_m: ArrayLike, at: Place) -> tuple[Floats, Floats, Floats]:
    """Latitude (rad), longitude (rad) and height (m) of (n, 3) positions in the tangent frame with its origin at `at`.

    Raises:
        DataError: where pymap3d is not installed.
    """
    north, east, down = np.moveaxis(np.asarray(position_t_m, dtype=np.float64), -1, 0)
    latitude, longitude, height = _pymap3d().ned2geodetic(
        north, east, down, at.latitude_rad, at.longitude_rad, at.height_m, deg=False
    )
    return np.asarray(latitude), np.asarray(longitude), np.asarray(height)
