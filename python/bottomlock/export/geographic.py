"""The formats on the Earth: KML 2.2 (OGC 07-147r2) and GeoJSON (RFC 7946)."""

import json
from collections.abc import Sequence
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from bottomlock.errors import DataError
from bottomlock.export.text import decimal, utc
from bottomlock.export.tracks import ExportTrack
from bottomlock.recordings.streams import Floats

NO_ORIGIN = (
    "kml and geojson need a place on the Earth, and there is none; give origin.latitude_deg and "
    "origin.longitude_deg, or export csv, tum or mcap"
)
_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
<Document>"""


def _coordinates(track: ExportTrack) -> Floats:
    """(n, 3) longitude, latitude, deg, and height, m; (n, 2) where heights were not recorded.

    Raises:
        DataError: without an origin on the Earth.
    """
    if track.geodetic is None:
        raise DataError(NO_ORIGIN)
    return track.geodetic[:, [1, 0, 2] if track.has_height else [1, 0]]


def kml(title: str, tracks: Sequence[ExportTrack]) -> str:
    """A document with a placemark a track, on the surface; heights above the ellipsoid, m, where they were recorded.

    A track with times is a `gx:Track`, one without a `LineString`.

    Raises:
        DataError: without an origin on the Earth.
    """
    marks = map(_placemark, tracks)
    return "\n".join([_HEAD, f"<name>{escape(title)}</name>", *marks, "</Document>", "</kml>", ""])


def _placemark(track: ExportTrack) -> str:
    places = [list(map(decimal, place)) for place in _coordinates(track)]
    if track.is_utc:
        shape = "gx:Track"
        lines = [f"<when>{utc(time_ns)}</when>" for time_ns in track.time_ns]
        lines += [f"<gx:coord>{' '.join([*place, '0'][:3])}</gx:coord>" for place in places]
    else:
        shape = "LineString"
        lines = ["<coordinates>", *(",".join(place) for place in places), "</coordinates>"]
    # Alpha, blue, green, red, two hex digits each.
    colour = "ff" + "".join(track.colour[k : k + 2] for k in (5, 3, 1))
    return "\n".join(
        [
            "<Placemark>",
            f"<name>{escape(track.name)}</name>",
            f"<description>{escape(track.description)}</description>",
            f"<Style><LineStyle><color>{colour}</color><width>3</width></LineStyle></Style>",
            f"<{shape}>",
            "<altitudeMode>clampToGround</altitudeMode>",
            *lines,
            f"</{shape}>",
            "</Placemark>",
        ]
    )


def geojson(title: str, tracks: Sequence[ExportTrack]) -> str:
    """A feature a track, a `LineString`; `coordinateProperties.times` has a UTC time a point, where the clock is UTC.

    Raises:
        DataError: without an origin on the Earth, for a single point and across 180 degrees of longitude.
    """
    features = [_feature(title, track) for track in tracks]
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False) + "\n"


def _feature(title: str, track: ExportTrack) -> dict[str, Any]:
    if len(track.time_ns) < 2:
        raise DataError("has one point", place=track.name, expected="two or more for a line of GeoJSON")
    coordinates = _coordinates(track)
    if (np.abs(np.diff(coordinates[:, 0])) > 180.0).any():
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
    geometry = {"type": "LineString", "coordinates": coordinates.tolist()}
    return {"type": "Feature", "properties": properties, "geometry": geometry}
