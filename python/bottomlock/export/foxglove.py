"""Messages of MCAP in JSON: poses and places by the schemas of Foxglove, estimates, beams and fixes by our own."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import polars as pl

from bottomlock.export.tracks import ExportTrack
from bottomlock.recordings.streams import Floats

FRAME = "map"
"""East-north-up at the origin, the name by REP 105."""

POSE, LOCATION = "foxglove.PoseInFrame", "foxglove.LocationFix"
DIAGONAL_KNOWN = 2
"""`position_covariance_type` of a covariance of which the diagonal is known."""

_TIME = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
    },
}


def _vector(title: str, axes: str) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": {axis: {"type": "number"} for axis in axes}}


SCHEMAS: Mapping[str, dict[str, Any]] = {
    POSE: {
        "title": POSE,
        "type": "object",
        "properties": {
            "timestamp": _TIME,
            "frame_id": {"type": "string"},
            "pose": {
                "title": "foxglove.Pose",
                "type": "object",
                "properties": {
                    "position": _vector("foxglove.Vector3", "xyz"),
                    "orientation": _vector("foxglove.Quaternion", "xyzw"),
                },
            },
        },
    },
    LOCATION: {
        "title": LOCATION,
        "type": "object",
        "properties": {
            "timestamp": _TIME,
            "frame_id": {"type": "string"},
            "latitude": {"type": "number"},
            "longitude": {"type": "number"},
            "altitude": {"type": "number"},
            "position_covariance": {
                "type": "array",
                "items": {"type": "number"},
                "minItems": 9,
                "maxItems": 9,
            },
            "position_covariance_type": {
                "title": "foxglove.PositionCovarianceType",
                "oneOf": [
                    {"title": title, "const": k}
                    for k, title in enumerate(("UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN"))
                ],
            },
        },
    },
}
"""https://github.com/foxglove/schemas, schemas/jsonschema, without the descriptions."""

Message = tuple[int, dict[str, Any]]
"""Time, ns, and content."""


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
    return {"title": title, "type": "object", "properties": properties}


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
        pose = {
            "position": _named("xyz", position),
            "orientation": _named("xyzw", orientation),
        }
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
