"""The points of a track in a KML or GeoJSON file."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.files.table_file import check_regular

Floats = NDArray[np.float64]
LARGEST_BYTES = 256 * 1024 * 1024
"""A track is held in memory as text and as numbers."""


@dataclass(frozen=True, eq=False)
class Points:
    """The points of a track.

    Attributes:
        longitude_deg: (n,) WGS 84.
        latitude_deg: (n,)
        height_m: (n,) above the sea; None where no point has one.
        times: ISO 8601 text of each point; None without times.
    """

    longitude_deg: Floats
    latitude_deg: Floats
    height_m: Floats | None
    times: Sequence[str] | None


def _read(path: Path) -> bytes:
    check_regular(path)
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise DataError(
                f"{path}: larger than {LARGEST_BYTES // 1024**2} MiB, expected a track of waypoints"
            )
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error


def _points(rows: Sequence[Sequence[float]], times: Sequence[str] | None, place: str) -> Points:
    """Rows of longitude, latitude and perhaps height as points.

    Raises:
        DataError: for a row that is something else, and times that are not one for each point.
    """
    if not rows:
        raise DataError(f"{place}: has no points")
    if times is not None and len(times) != len(rows):
        raise DataError(f"{place}: {len(times)} times for {len(rows)} points, expected one for each")
    for k, row in enumerate(rows):
        if len(row) not in {2, 3} or not np.isfinite(row).all():
            raise DataError(
                f"{place}: point {k} is {list(row)}, expected longitude, latitude and perhaps height"
            )
    heights = [row[2] if len(row) == 3 else None for row in rows]
    lacking = [k for k, height in enumerate(heights) if height is None]
    if lacking and len(lacking) < len(rows):
        raise DataError(
            f"{place}: point {lacking[0]} has no height, expected one for every point or for none"
        )
    values = np.array([row[:2] for row in rows], np.float64)
    return Points(values[:, 0], values[:, 1], None if lacking else np.array(heights, np.float64), times)


class _KmlTracks:
    """Collects `LineString` coordinates and `gx:Track` points of a KML file as its elements pass."""

    def __init__(self, place: str) -> None:
        self.place = place
        self.lines: list[list[list[float]]] = []
        self.tracks: list[tuple[list[list[float]], list[str]]] = []
        self._inside: list[str] = []
        self._text: list[str] = []

    def doctype(self, *_: object) -> None:
        """A document type can define entities that grow without bound; KML needs none."""
        raise DataError(
            f"{self.place}: has a document type (<!DOCTYPE ...>), which no KML track needs; take it out"
        )

    def start(self, name: str, _attributes: object) -> None:
        """An element begins."""
        name = name.rpartition(":")[2]
        self._inside.append(name)
        self._text.clear()
        if name == "Track":
            self.tracks.append(([], []))

    def text(self, text: str) -> None:
        """Text within an element."""
        self._text.append(text)

    def end(self, name: str) -> None:
        """An element ends."""
        name = name.rpartition(":")[2]
        text = "".join(self._text).strip()
        self._text.clear()
        self._inside.pop()
        if name == "coordinates" and self._inside and self._inside[-1] == "LineString":
            self.lines.append([self._numbers(part.split(",")) for part in text.split()])
        elif name == "coord" and self.tracks:
            self.tracks[-1][0].append(self._numbers(text.split()))
        elif name == "when" and self.tracks and "Track" in self._inside:
            self.tracks[-1][1].append(text)

    def _numbers(self, parts: Sequence[str]) -> list[float]:
        try:
            return [float(part) for part in parts if part]
        except ValueError as error:
            raise DataError(f"{self.place}: coordinates '{' '.join(parts)}' are no numbers") from error


def read_kml(path: Path) -> Points:
    """The one `LineString` or `gx:Track` of a KML file.

    Raises:
        DataError: for XML that is not well-formed or has a document type, and for no track or several.
    """
    place, data = str(path), _read(path)
    found = _KmlTracks(place)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = found.doctype
    parser.StartElementHandler = found.start
    parser.CharacterDataHandler = found.text
    parser.EndElementHandler = found.end
    try:
        parser.Parse(data, True)  # noqa: FBT003 - expat's own argument, "the last part"
    except expat.ExpatError as error:
        raise DataError(f"{place}: is no XML ({error})") from error
    count = len(found.lines) + len(found.tracks)
    if count != 1:
        raise DataError(
            f"{place}: {count} tracks (LineString or gx:Track), expected one; keep that which is to be flown"
        )
    if found.lines:
        return _points(found.lines[0], None, place)
    rows, times = found.tracks[0]
    return _points(rows, times or None, place)


def read_geojson(path: Path) -> Points:
    """The one `LineString` of a GeoJSON file, or its `Point` features in order.

    Times are the property `coordTimes` or `times` of the line, or `time` of each point.

    Raises:
        DataError: for no JSON, and for no track or several.
    """
    place = str(path)
    try:
        content = json.loads(_read(path))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{place}: is no JSON ({error})") from error
    features = _features(content)
    lines = [one for one in features if one[0] == "LineString"]
    points = [one for one in features if one[0] == "Point"]
    if len(lines) == 1:
        _, rows, properties = lines[0]
        times = properties.get("coordTimes", properties.get("times"))
        return _points(_rows(rows, place), _texts(times, place), place)
    if lines or not points:
        raise DataError(
            f"{place}: {len(lines)} lines (LineString), expected one, or points; keep that which is to be flown"
        )
    stamps = [properties.get("time") for _, _, properties in points]
    times = None if all(stamp is None for stamp in stamps) else stamps
    return _points(_rows([rows for _, rows, _ in points], place), _texts(times, place), place)


def _features(content: Any) -> list[tuple[str, Any, dict[str, Any]]]:  # noqa: ANN401 - whatever a file holds
    """Kind, coordinates and properties of every geometry."""
    if not isinstance(content, dict):
        return []
    if content.get("type") == "FeatureCollection":
        inner = content.get("features")
        return [one for part in (inner if isinstance(inner, list) else []) for one in _features(part)]
    geometry = content.get("geometry") if content.get("type") == "Feature" else content
    if not isinstance(geometry, dict):
        return []
    properties = content.get("properties")
    return [
        (
            str(geometry.get("type")),
            geometry.get("coordinates"),
            properties if isinstance(properties, dict) else {},
        )
    ]


def _rows(rows: Any, place: str) -> list[list[float]]:  # noqa: ANN401 - whatever a file holds
    if not isinstance(rows, list):
        raise DataError(f"{place}: coordinates are no list of points")
    for k, row in enumerate(rows):
        # A whole number of a thousand digits is JSON, and no float.
        if not isinstance(row, list) or not all(
            isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12
            for value in row
        ):
            raise DataError(
                f"{place}: point {k} is {str(row)[:60]}, expected longitude, latitude and perhaps height"
            )
    return [[float(value) for value in row] for row in rows]


def _texts(times: Any, place: str) -> list[str] | None:  # noqa: ANN401 - whatever a file holds
    if times is None:
        return None
    if not isinstance(times, list) or not all(isinstance(stamp, str) for stamp in times):
        raise DataError(f"{place}: times are no list of ISO 8601 texts, expected one for each point")
    return times
