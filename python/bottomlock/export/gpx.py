"""GPX 1.1: a `trk` a track; times are left out where the clock is not UTC, heights not recorded too."""

from collections.abc import Sequence
from xml.sax.saxutils import escape

from bottomlock.export.geographic import Point, points
from bottomlock.export.tracks import ExportTrack

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<gpx version="1.1" creator="bottomlock" xmlns="http://www.topografix.com/GPX/1/1">"""


def gpx(title: str, tracks: Sequence[ExportTrack]) -> str:
    """A GPX file with a title.

    Raises:
        DataError: without an origin on the Earth.
    """
    return "\n".join(
        [HEAD, f"<metadata><name>{escape(title)}</name></metadata>", *map(_track, tracks), "</gpx>", ""]
    )


def _track(track: ExportTrack) -> str:
    rows = "\n".join(map(_point, points(track)))
    name, words = escape(track.name), escape(track.description)
    return f"<trk>\n<name>{name}</name>\n<desc>{words}</desc>\n<trkseg>\n{rows}\n</trkseg>\n</trk>"


def _point(point: Point) -> str:
    time = "" if point.utc is None else f"<time>{point.utc}</time>"
    height = "" if point.height is None else f"<ele>{point.height}</ele>"
    return f'<trkpt lat="{point.latitude}" lon="{point.longitude}">{height}{time}</trkpt>'
