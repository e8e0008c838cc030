"""MCAP: the tracks, the beams and the fixes of a replay as messages in JSON."""

import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.replay.export.foxglove import (
    LOCATION,
    POSE,
    SCHEMAS,
    Message,
    location_messages,
    pose_messages,
    row_messages,
    row_schema,
)
from bottomlock.replay.export.tracks import ExportTrack
from bottomlock.replay.report import ReplayTables
from bottomlock.support.extras import install

TEXT = ("case", "what_if", "run", "method", "pass")
"""Columns that the topic states."""


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


def mcap(tables: ReplayTables, tracks: Sequence[ExportTrack]) -> bytes:
    """An MCAP file: for each track `/NAME/pose`, `/NAME/location`, `/NAME/estimate` and `/NAME/fix`, `/WHAT_IF/beams`.

    Raises:
        DataError: where mcap is not installed, and for times before zero, which MCAP cannot hold.
    """
    library = writer_library()
    file = io.BytesIO()
    writer = library.Writer(file)
    writer.start(profile="", library="bottomlock")
    schemas: dict[str, int] = {}
    messages: list[tuple[int, int, dict[str, Any]]] = []
    for topic in topics(tables, tracks):
        title = topic.schema["title"]
        if title not in schemas:
            data = json.dumps(topic.schema).encode()
            schemas[title] = writer.register_schema(name=title, encoding="jsonschema", data=data)
        channel = writer.register_channel(topic=topic.name, message_encoding="json", schema_id=schemas[title])
        messages += ((time_ns, channel, content) for time_ns, content in topic.messages)
    messages.sort(key=lambda one: one[:2])
    if messages and messages[0][0] < 0:
        raise DataError(
            f"MCAP holds no time before 0, and a track has {messages[0][0]} ns; export another format"
        )
    for time_ns, channel, content in messages:
        data = json.dumps(content, allow_nan=False).encode()
        writer.add_message(channel_id=channel, log_time=time_ns, publish_time=time_ns, data=data)
    writer.finish()
    return file.getvalue()


def topics(tables: ReplayTables, tracks: Sequence[ExportTrack]) -> list[Topic]:
    """The channels of a file that have messages; fixes are those of the forward pass."""
    found = []
    for track in tracks:
        if track.orientation_enu_flu is not None:
            found.append(Topic(f"/{track.name}/pose", SCHEMAS[POSE], pose_messages(track)))
        if track.geodetic is not None:
            found.append(Topic(f"/{track.name}/location", SCHEMAS[LOCATION], location_messages(track)))
        title = "bottomlock.Estimate" if track.what_if else "bottomlock.Reference"
        found.append(_rows(f"/{track.name}/estimate", title, track.rows))
    for name in dict.fromkeys(track.what_if for track in tracks if track.what_if):
        rows = _first_run(tables.pings, name)
        valid = [column for column in rows.columns if column.endswith("_valid")]
        counted = rows.with_columns(pl.sum_horizontal(valid).cast(pl.Int64).alias("beams_valid"))
        found.append(_rows(f"/{name}/beams", "bottomlock.Beams", counted))
        for method in dict.fromkeys(track.method for track in tracks if track.what_if == name):
            fixes = _first_run(tables.innovations, name).filter(pl.col("method") == method)
            found.append(_rows(f"/{name}_{method}/fix", "bottomlock.Fix", fixes))
    return found


def _rows(topic: str, title: str, rows: pl.DataFrame) -> Topic:
    numbers = rows.drop(TEXT, strict=False)
    return Topic(topic, row_schema(title, numbers.schema), row_messages(numbers))


def _first_run(table: pl.DataFrame, what_if: str) -> pl.DataFrame:
    return table.filter((pl.col("what_if") == what_if) & (pl.col("run") == pl.col("run").min()))
