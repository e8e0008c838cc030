"""MCAP: the tracks, their beams and their fixes as messages in JSON."""

import heapq
import io
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import polars as pl

from bottomlock.errors import DataError
from bottomlock.export.foxglove import (
    LOCATION,
    POSE,
    SCHEMAS,
    Message,
    location_messages,
    pose_messages,
    row_messages,
    row_schema,
)
from bottomlock.export.tracks import Export
from bottomlock.support.extras import install

TEXT = ("case", "what_if", "trajectory", "run", "method", "pass")
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
