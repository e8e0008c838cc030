"""What the formats on the Earth share: points as text, and times where they are UTC."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bottomlock.errors import DataError
from bottomlock.export.decimals import decimal, utc
from bottomlock.export.tracks import ExportTrack
from bottomlock.recordings.streams import Floats

NO_ORIGIN = (
    "kml and geojson need a place on the Earth, and there is none; give origin.latitude_deg and "
    "origin.longitude_deg, or export csv, tum or mcap"
)


@dataclass(frozen=True)
class Point:
    """Longitude and latitude, deg, height, m, and UTC.

    The height is None where none was recorded, the time where the clock is not UTC.
    """

    longitude: str
    latitude: str
    height: str | None
    utc: str | None


def geodetic(track: ExportTrack) -> Floats:
    """(n, 3) latitude, longitude, deg, and height, m.

    Raises:
        DataError: without an origin on the Earth.
    """
    if track.geodetic is None:
        raise DataError(NO_ORIGIN)
    return track.geodetic


def points(track: ExportTrack) -> Iterator[Point]:
    """The points of a track.

    Raises:
        DataError: without an origin on the Earth.
    """
    is_utc = track.is_utc
    for time_ns, (latitude, longitude, height) in zip(track.time_ns, geodetic(track), strict=True):
        of_height = decimal(height) if track.has_height else None
        yield Point(decimal(longitude), decimal(latitude), of_height, utc(time_ns) if is_utc else None)


def crosses_antimeridian(track: ExportTrack) -> bool:
    """Whether the track crosses 180 degrees of longitude."""
    return bool((np.abs(np.diff(geodetic(track)[:, 1])) > 180.0).any())
