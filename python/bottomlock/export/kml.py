"""KML 2.2 (OGC 07-147r2): a track with times as `gx:Track`, without as `LineString`."""

from collections.abc import Sequence
from xml.sax.saxutils import escape

from bottomlock.export.geographic import points
from bottomlock.export.tracks import ExportTrack

HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">
<Document>"""


def kml(title: str, tracks: Sequence[ExportTrack]) -> str:
    """A document with a placemark a track, on the surface; heights above the ellipsoid, m, where they were recorded.

    Raises:
        DataError: without an origin on the Earth.
    """
    return "\n".join(
        [HEAD, f"<name>{escape(title)}</name>", *map(_placemark, tracks), "</Document>", "</kml>", ""]
    )


def _placemark(track: ExportTrack) -> str:
    shape = _timed(track) if track.is_utc else _line(track)
    return f"""<Placemark>
<name>{escape(track.name)}</name>
<description>{escape(track.description)}</description>
<Style><LineStyle><color>{_colour(track)}</color><width>3</width></LineStyle></Style>
{shape}
</Placemark>"""


def _timed(track: ExportTrack) -> str:
    found = list(points(track))
    when = "\n".join(f"<when>{one.utc}</when>" for one in found)
    where = "\n".join(
        f"<gx:coord>{one.longitude} {one.latitude} {one.height or 0}</gx:coord>" for one in found
    )
    return f"<gx:Track>\n<altitudeMode>clampToGround</altitudeMode>\n{when}\n{where}\n</gx:Track>"


def _line(track: ExportTrack) -> str:
    where = "\n".join(
        ",".join(filter(None, [one.longitude, one.latitude, one.height])) for one in points(track)
    )
    inner = f"<altitudeMode>clampToGround</altitudeMode>\n<coordinates>\n{where}\n</coordinates>"
    return f"<LineString>\n{inner}\n</LineString>"


def _colour(track: ExportTrack) -> str:
    """Alpha, blue, green, red, two hex digits each."""
    return "ff" + "".join(track.colour[k : k + 2] for k in (5, 3, 1))
