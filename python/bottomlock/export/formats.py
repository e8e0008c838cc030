"""The formats by name: what each needs, its files, and how they are written beside one another; MCAP in JSON."""

import heapq
import io
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import polars as pl

from bottomlock.errors import DataError, ScenarioError
from bottomlock.export.tracks import Export, ExportTrack
from bottomlock.files.overwriting import Files, Result
from bottomlock.live.raw_log import mcap_library
from bottomlock.recordings.streams import Floats

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


def comma_separated(track: ExportTrack, pings: pl.DataFrame | None) -> str:
    """The columns of the track's rows after `utc`, angles in degrees; with the beams of the last ping up to each time.

    Args:
        track: the track.
        pings: of its group; None for none.

    `utc` is empty where the clock is not UTC.
    """
    rows = track.rows
    times = [utc(time_ns) for time_ns in track.time_ns] if track.is_utc else [None] * rows.height
    rows = rows.select(pl.Series("utc", times, dtype=pl.String()), pl.all())
    radians = [name for name in rows.columns if name.endswith("_rad")]
    rows = rows.with_columns(pl.col(radians).degrees())
    rows = rows.rename({name: f"{name.removesuffix('rad')}deg" for name in radians})
    if pings is not None:
        beams = pings.select("time_ns", pl.col("time_ns").alias("ping_time_ns"), _COUNT, _VALID)
        rows = rows.join_asof(beams, on="time_ns")
    return rows.write_csv()


_VALID = pl.col("^.*_valid$")
_COUNT = pl.sum_horizontal(_VALID).cast(pl.Int64).alias("beams_valid")


def tum(track: ExportTrack) -> str:
    """A trajectory, m, after a line with frames and description that begins with #.

    Of a track without an attitude the orientation is the identity, not to be compared.

    Raises:
        DataError: for a track without positions.
    """
    orientation = track.orientation_enu_flu
    if orientation is None:
        orientation = np.tile(IDENTITY, (len(track.time_ns), 1))
    position = track.position_enu_m
    if position is None:
        raise DataError(
            "has velocities and no positions, which TUM needs", place=track.name, hint="export csv or mcap"
        )
    rows = np.hstack([position, orientation])
    lines = (
        " ".join([seconds(time_ns), *map(decimal, row)])
        for time_ns, row in zip(track.time_ns, rows, strict=True)
    )
    described = track.description.replace("\n", " ")
    frames = f"east north up from the origin, orientation of forward left up; {described}"
    return "\n".join([f"# {frames}", *lines]) + "\n"


def decimal(value: float) -> str:
    """The shortest decimal number that reads back as the same double, without an exponent.

    >>> decimal(54.1), decimal(-1e-7), decimal(12.0)
    ('54.1', '-0.0000001', '12')
    """
    return np.format_float_positional(value, trim="-")


def seconds(time_ns: int) -> str:
    """A time in seconds, exact to the nanosecond.

    >>> seconds(1_767_225_610_250_000_001), seconds(-1)
    ('1767225610.250000001', '-0.000000001')
    """
    whole, rest = divmod(abs(int(time_ns)), 10**9)
    return f"{'-' if time_ns < 0 else ''}{whole}.{rest:09d}"


def utc(time_ns: int) -> str:
    """Unix time in ISO 8601, exact to the nanosecond; the fraction is left out where it is zero.

    >>> utc(1_767_225_610_250_000_001), utc(1_767_225_610 * 10**9)
    ('2026-01-01T00:00:10.250000001Z', '2026-01-01T00:00:10Z')
    """
    whole, rest = divmod(int(time_ns), 10**9)
    fraction = f".{rest:09d}".rstrip("0").rstrip(".")
    return f"{np.datetime64(whole, 's')}{fraction}Z"


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


EARTH: Mapping[str, Callable[[str, Sequence[ExportTrack]], str]] = {"kml": kml, "geojson": geojson}
"""Formats that need a place on the Earth; one file has every track."""
POSITIONS = (*EARTH, "tum")
"""Formats that have nothing but positions and attitudes."""
FORMATS = (*EARTH, "csv", "tum", "mcap")
FOLDER = "export"


def check_formats(formats: Sequence[str], *, has_origin: bool = True, has_position: bool = True) -> None:
    """Checks what can be known beforehand.

    Raises:
        ScenarioError: for none, and for one that is unknown.
        DataError: for a format on the Earth without an origin there, one of positions without any, and where mcap is
            wanted and not installed.
    """
    if not formats:
        raise ScenarioError(
            "names no format", key="--export", expected=f"of {', '.join(FORMATS)}, separated by commas"
        )
    for name in formats:
        if name not in FORMATS:
            raise ScenarioError(
                "is no format", place="--export", key=f"'{name}'", expected=f"of {', '.join(FORMATS)}"
            )
        if not has_position and name in POSITIONS:
            raise DataError(
                f'{name} needs positions, and mode = "velocity" estimates none',
                place="--export",
                hint="export csv or mcap",
            )
        if not has_origin and name in EARTH:
            raise DataError(NO_ORIGIN)
    if "mcap" in formats:
        mcap_library()


def files_of(export: Export, name: str) -> Files:
    """The contents of the files of a format, by name.

    Raises:
        DataError: for tracks that the format cannot hold.
    """
    tracks = export.tracks
    if name in EARTH:
        return {f"tracks.{name}": EARTH[name](export.title, tracks)}
    if name == "csv":
        return {f"{one.name}.csv": comma_separated(one, export.pings.get(one.group)) for one in tracks}
    if name == "tum":
        return {f"{one.name}.tum": tum(one) for one in tracks}
    return {"tracks.mcap": mcap(export)}


def write_export(
    make: Callable[[], Export],
    formats: Sequence[str],
    folder: Path,
    command: str,
    made_from: Mapping[str, str],
    inputs: Sequence[Path] = (),
    *,
    force: bool,
    below: str = FOLDER,
) -> list[Path]:
    """Writes every format, or, where one cannot be made, none; each replaces its own files and no others.

    Args:
        make: gives the tracks, once it is known that they may be written.
        formats: of `FORMATS`.
        folder: of the results.
        command: that makes them, as the following of `Result`.
        made_from: digests of what they are made of.
        inputs: files that are read.
        force: replace files that have changed since they were written.
        below: folder of the files, below that of the results; "" for that itself.

    Returns:
        The files.

    Raises:
        DataError: for tracks that a format cannot hold.
        OutputError: for a file of these names that is not of ours, one that has changed since without `force`, and
            where the folder cannot be written.
    """
    results = {
        name: Result(folder, f"{FOLDER}_{name}", command, made_from, inputs, beside=True) for name in formats
    }
    for result in results.values():
        result.check(force=force)
    export, before = make(), f"{below}/" if below else ""
    made = [
        (result, {f"{before}{file}": content for file, content in files_of(export, name).items()})
        for name, result in results.items()
    ]
    return [path for result, files in made for path in result.write(files, force=force)]


TEXT = ("case", "what_if", "trajectory", "run", "method", "pass")
"""Columns that the topic states."""


Message = tuple[int, dict[str, Any]]
"""Time, ns, and content."""


@dataclass(frozen=True)
class Topic:
    """A channel: its name, the title and content of its schema, its messages."""

    name: str
    schema: dict[str, Any]
    messages: Iterable[Message]


def mcap(export: Export) -> bytes:
    """An MCAP file: for each track `/NAME/pose`, `/NAME/location` and `/NAME/estimate`, for each group `/GROUP/beams`.

    Raises:
        DataError: where mcap is not installed, and for times before zero, which MCAP cannot hold.
    """
    library = mcap_library().writer
    file = io.BytesIO()
    writer = library.Writer(file)
    writer.start(profile="", library="bottomlock")
    schemas: dict[str, int] = {}
    streams: list[Iterator[tuple[int, int, dict[str, Any]]]] = []
    for topic in topics(export):
        title = topic.schema["title"]
        if title not in schemas:
            data = json.dumps(topic.schema).encode()
            schemas[title] = writer.register_schema(name=title, encoding="jsonschema", data=data)
        channel = writer.register_channel(topic=topic.name, message_encoding="json", schema_id=schemas[title])
        streams.append(_numbered(channel, topic.messages))
    for time_ns, channel, content in heapq.merge(*streams, key=lambda one: one[:2]):
        if time_ns < 0:
            raise DataError(
                f"MCAP holds no time before 0, and a track has {time_ns} ns", hint="export another format"
            )
        data = json.dumps(content, allow_nan=False).encode()
        writer.add_message(channel_id=channel, log_time=time_ns, publish_time=time_ns, data=data)
    writer.finish()
    return file.getvalue()


def _numbered(channel: int, messages: Iterable[Message]) -> Iterator[tuple[int, int, dict[str, Any]]]:
    """Time, channel and content."""
    for time_ns, content in messages:
        yield time_ns, channel, content


def topics(export: Export) -> list[Topic]:
    """The channels of a file."""
    found = []
    for track in export.tracks:
        if track.position_t_m is not None and track.orientation_enu_flu is not None:
            found.append(Topic(f"/{track.name}/pose", SCHEMAS[POSE], pose_messages(track)))
        if track.geodetic is not None:
            found.append(Topic(f"/{track.name}/location", SCHEMAS[LOCATION], location_messages(track)))
        title = "bottomlock.Estimate" if track.group else "bottomlock.Reference"
        found.append(_rows(f"/{track.name}/estimate", title, track.rows))
    for group, pings in export.pings.items():
        found.append(_rows(f"/{group}/beams", "bottomlock.Beams", pings.with_columns(_COUNT)))
    return found + [_rows(f"/{name}", f"bottomlock.{title}", rows) for title, name, rows in export.further]


def _rows(topic: str, title: str, rows: pl.DataFrame) -> Topic:
    numbers = rows.drop(TEXT, strict=False).sort("time_ns", maintain_order=True)
    return Topic(topic, row_schema(title, numbers.schema), row_messages(numbers))


FRAME = "map"
"""East-north-up at the origin, the name by REP 105."""

POSE, LOCATION = "foxglove.PoseInFrame", "foxglove.LocationFix"
DIAGONAL_KNOWN = 2
"""`position_covariance_type` of a covariance of which the diagonal is known."""


def _object(title: str, **properties: Any) -> dict[str, Any]:  # noqa: ANN401 - schemas
    return {"title": title, "type": "object", "properties": properties}


_NUMBER, _STRING = {"type": "number"}, {"type": "string"}
_TIME = _object(
    "time",
    sec={"type": "integer", "minimum": 0},
    nsec={"type": "integer", "minimum": 0, "maximum": 999_999_999},
)
_VECTOR = _object("foxglove.Vector3", **dict.fromkeys("xyz", _NUMBER))
_QUATERNION = _object("foxglove.Quaternion", **dict.fromkeys("xyzw", _NUMBER))
_KINDS = ("UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN")
SCHEMAS: Mapping[str, dict[str, Any]] = {
    POSE: _object(
        POSE,
        timestamp=_TIME,
        frame_id=_STRING,
        pose=_object("foxglove.Pose", position=_VECTOR, orientation=_QUATERNION),
    ),
    LOCATION: _object(
        LOCATION,
        timestamp=_TIME,
        frame_id=_STRING,
        latitude=_NUMBER,
        longitude=_NUMBER,
        altitude=_NUMBER,
        position_covariance={"type": "array", "items": _NUMBER, "minItems": 9, "maxItems": 9},
        position_covariance_type={
            "title": "foxglove.PositionCovarianceType",
            "oneOf": [{"title": title, "const": k} for k, title in enumerate(_KINDS)],
        },
    ),
}
"""https://github.com/foxglove/schemas, schemas/jsonschema, without the descriptions."""


def row_schema(title: str, columns: pl.Schema) -> dict[str, Any]:
    """The JSON schema of the rows of a table; what is null in a row is left out of its message."""
    names = {
        pl.String: "string",
        pl.Boolean: "boolean",
        pl.Int64: "integer",
        pl.Float32: "number",
        pl.Float64: "number",
    }
    properties = {name: {"type": names[dtype.base_type()]} for name, dtype in columns.items()}
    return _object(title, **properties)


def row_messages(rows: pl.DataFrame) -> Iterator[Message]:
    """A message a row of a table with `time_ns`."""
    for row in rows.iter_rows(named=True):
        yield row["time_ns"], {name: value for name, value in row.items() if value is not None}


def pose_messages(track: ExportTrack) -> Iterator[Message]:
    """`foxglove.PoseInFrame` of a track with an attitude: forward-left-up axes in east-north-up."""
    positions, orientations = track.position_enu_m, track.orientation_enu_flu
    if positions is None or orientations is None:
        return
    for time_ns, position, orientation in zip(track.time_ns.tolist(), positions, orientations, strict=True):
        pose = {"position": _named("xyz", position), "orientation": _named("xyzw", orientation)}
        yield time_ns, {"timestamp": _stamp(time_ns), "frame_id": FRAME, "pose": pose}


def location_messages(track: ExportTrack) -> Iterator[Message]:
    """`foxglove.LocationFix` of a track with an origin; with the claimed variances where the track has them."""
    if track.geodetic is None:
        return
    covariance = _covariance_enu_m2(track)
    for k, (time_ns, place) in enumerate(zip(track.time_ns.tolist(), track.geodetic, strict=True)):
        content: dict[str, Any] = {"timestamp": _stamp(time_ns), "frame_id": FRAME}
        content |= dict(zip(("latitude", "longitude", "altitude"), place.tolist(), strict=True))
        if covariance is not None and np.isfinite(covariance[k]).all():
            content["position_covariance"] = np.diag(covariance[k]).ravel().tolist()
            content["position_covariance_type"] = DIAGONAL_KNOWN
        yield time_ns, content


def _covariance_enu_m2(track: ExportTrack) -> Floats | None:
    """(n, 3) variances east, north and up, m², as claimed."""
    names = [f"sd_position_{axis}_m" for axis in ("east", "north", "down")]
    if names[0] not in track.rows.columns:
        return None
    return np.asarray(track.rows.select(pl.col(names).fill_null(np.nan)).to_numpy() ** 2)


def _named(axes: str, values: Floats) -> dict[str, float]:
    return dict(zip(axes, values.tolist(), strict=True))


def _stamp(time_ns: int) -> dict[str, int]:
    sec, nsec = divmod(time_ns, 10**9)
    return {"sec": sec, "nsec": nsec}
