"""GeoJSON (RFC 7946): a feature a track, a `LineString`."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from bottomlock.errors import DataError
from bottomlock.export.decimals import utc
from bottomlock.export.geographic import crosses_antimeridian, geodetic
from bottomlock.export.tracks import ExportTrack


def geojson(title: str, tracks: Sequence[ExportTrack]) -> str:
    """A feature collection; `coordinateProperties.times` has a UTC time a point, where the clock is UTC.

    Raises:
        DataError: without an origin on the Earth, for a single point and across 180 degrees of longitude.
    """
    features = [_feature(title, track) for track in tracks]
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False) + "\n"


def _feature(title: str, track: ExportTrack) -> dict[str, Any]:
    if len(track.time_ns) < 2:
        raise DataError("has one point", place=track.name, expected="two or more for a line of GeoJSON")
    if crosses_antimeridian(track):
        raise DataError(
            "crosses 180° of longitude, where GeoJSON wants lines cut",
            place=track.name,
            hint="export another format",
        )
    properties: dict[str, Any] = {
        "name": track.name,
        "description": track.description,
        "case": title,
        "group": track.group,
        "method": track.method,
    }
    if track.is_utc:
        properties["coordinateProperties"] = {"times": [utc(time_ns) for time_ns in track.time_ns]}
    # RFC 7946, section 3.1.1: longitude, latitude, height above the ellipsoid.
    coordinates = geodetic(track)[:, [1, 0, 2] if track.has_height else [1, 0]]
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": "LineString", "coordinates": np.asarray(coordinates).tolist()},
    }
