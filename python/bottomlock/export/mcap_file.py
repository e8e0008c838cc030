"""MCAP: the tracks, their beams and their fixes as messages in JSON."""

import heapq
import io
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from bottomlock.errors import DataError
from bottomlock.export.tracks import Export, ExportTrack
from bottomlock.recordings.streams import Floats
from bottomlock.support.extras import install

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


def writer_library() -> Any:  # noqa: ANN401 - an extra
    """The library mcap.

    Raises:
        DataError: where it is not installed.
    """
    try:
        import mcap.writer  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DataError(f"MCAP files need mcap: {install('live')}") from error
    return mcap.writer


def mcap(export: Export) -> bytes:
    """An MCAP file: for each track `/NAME/pose`, `/NAME/location` and `/NAME/estimate`, for each group `/GROUP/beams`.

    Raises:
        DataError: where mcap is not installed, and for times before zero, which MCAP cannot hold.
    """
    library = writer_library()
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
        valid = [column for column in pings.columns if column.endswith("_valid")]
        counted = pings.with_columns(pl.sum_horizontal(valid).cast(pl.Int64).alias("beams_valid"))
        found.append(_rows(f"/{group}/beams", "bottomlock.Beams", counted))
    found += [_rows(f"/{name}/fix", "bottomlock.Fix", rows) for name, rows in export.fixes.items()]
    found += [_rows(f"/{name}", "bottomlock.Arrival", rows) for name, rows in export.arrivals.items()]
    return found


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
