"""Registry of the formats of `bottomlock convert`, and detection of a file's format.

A new format, for files and live, is a module with its `FORMAT`, and a line in `BYTES`.
"""

import codecs
import contextlib
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bottomlock.errors import DataError
from bottomlock.files.table_file import check_regular, content
from bottomlock.io import (
    ardupilot,
    cerulean,
    dataflash,
    linkquest,
    nortek_ad2cp,
    nortek_ascii,
    nortek_dvl,
    nucleus,
    nucleus_csv,
    pd0,
    ros,
    ros_waterlinked,
    table,
    tlog,
    waterlinked_json,
    waterlinked_serial,
    wayfinder,
)
from bottomlock.io.beam_table import Recording
from bottomlock.io.log_stream import velocities_recording
from bottomlock.io.rows import PLAIN, Options
from bottomlock.io.sentences import show
from bottomlock.text import did_you_mean

_HEAD = 65_536
_RECORD_BEAMS = "record PD0 in beam coordinates (PD0, EX00000), or a Water Linked's own protocol"
_UNREAD = (
    (
        rb":BI" + rb",\s{0,8}[+-]\s{0,8}[0-9]{1,6}" * 4 + rb",[AV]",
        "PD6 holds no beam velocities",
        _RECORD_BEAMS,
    ),
    (rb"^\x7d(\x00\x2d|\x01\x56)\x00", "PD4 and PD5 hold no beam velocities", _RECORD_BEAMS),
    (
        rb"\$DVPD[LX],",
        "$DVPDL and $DVPDX hold displacements and no beams",
        "record $DVKFC (Tracker 650: SEND-DVKFC ON) or $DVEXT (DVL-75: SEND-DVEXT ON)",
    ),
    (
        rb"^(\x1f\x8b|BZh[1-9]|\xfd7zXZ|\x28\xb5\x2f\xfd|PK\x03\x04|7z\xbc\xaf)",
        "is compressed",
        "unpack it first",
    ),
    (rb"^\s*\Z", "is empty", ""),
)
"""Marks of what is known and not read, what they lack, and what to record in their place."""
_TIMES_ITS_SIZE = 18.0
"""Memory that reading a log takes, over its size (measured: Wayfinder 17, DF21 12, PD0 9, Water Linked JSON 3)."""


@dataclass(frozen=True)
class PathFormat:
    """A format read from a path: by a library, with a map, or as one stream of a log of many."""

    name: str
    title: str
    sniff: Callable[[Path, bytes], bool]
    read: Callable[[Path, str, Options], Recording]


def _autopilot(module: Any, title: str, sniff: Callable[[bytes], bool]) -> PathFormat:  # noqa: ANN401 - as above
    """The velocities of a DVL in a log of streams, which have no beams."""

    def read(path: Path, place: str, options: Options) -> Recording:
        streams = module.streams(content(path, module.TIMES_ITS_SIZE), place)
        return velocities_recording(streams, place, module.NAME, options)

    return PathFormat(module.NAME, title, lambda _, head: sniff(head), read)


# From the most to the least specific mark: the first match is used. Nucleus before AD2CP: both begin with A5 records.
BYTES = (
    linkquest.FORMAT,
    nucleus_csv.FORMAT,
    nortek_ascii.FORMAT,
    cerulean.FORMAT,
    cerulean.DVL75,
    waterlinked_json.FORMAT,
    waterlinked_serial.FORMAT,
    nucleus.FORMAT,
    nortek_dvl.FORMAT,
    nortek_ad2cp.FORMAT,
    wayfinder.FORMAT,
    pd0.FORMAT,
)
PATHS = (
    PathFormat(ros.NAME, "messages of DVLs in ROS 1/2 bags, MCAP", ros.sniff_path, ros.read_path),
    _autopilot(ardupilot, "ArduPilot DataFlash .BIN (no beams: rejected with advice)", dataflash.sniff),
    _autopilot(tlog, "MAVLink .tlog (no beams: rejected with advice)", tlog.sniff),
    PathFormat(table.NAME, "CSV or Parquet, with a column map", table.sniff_path, table.read_path),
)
NAMES = tuple(one.name for one in (*BYTES, *PATHS))
MESSAGES = (ros.FORMAT, ros_waterlinked.FORMAT)
"""Messages with beams: each is a record, of none there is a file."""
LIVE = {one.name: one for one in (*BYTES, *MESSAGES) if one.live}
"""Formats with beams that come one ping after the other."""


def detect(path: Path) -> str:
    """Name of a file's format.

    Raises:
        DataError: for a missing file, and one in none of the formats, with what to record in place of a known one.
    """
    name = format_of(path)
    if name is not None:
        return name
    head = b"" if path.is_dir() else _head(path)
    for mark, why, instead in _UNREAD:
        if re.search(mark, head):
            raise DataError(why, place=path, hint=instead)
    if path.suffix.lower() in {".csv", ".txt"} and b"," in head.split(b"\n", 1)[0] and head.isascii():
        columns = show(head.split(b"\n", 1)[0])
        raise DataError(
            f"its first line, '{columns}', names no documented columns (time_ns, beam1_mps, beam1_valid ...)",
            place=path,
            hint=(
                f"`bottomlock convert {path} --init --out MAP.toml` writes a map of yours for "
                "--columns MAP.toml; or name the format with --format"
            ),
        )
    if path.is_dir():
        raise DataError(
            "is a folder without the metadata.yaml of a ROS 2 bag", place=path, expected="a file of the log"
        )
    raise DataError(
        "format not recognised from the content",
        place=path,
        expected=f"one of {', '.join(NAMES)}",
        hint="name it with --format, or map its columns with --columns",
    )


def format_of(path: Path) -> str | None:
    """Name of a file's format as its content shows it; None for a file in none of them.

    Raises:
        DataError: for a path that is no file or folder, or cannot be read.
    """
    _check_there(path)
    return _recognise(path, b"" if path.is_dir() else _head(path))


def _check_there(path: Path) -> None:
    """Checks that a path is a file or a folder: a pipe or a device may never end."""
    if not path.is_dir():
        check_regular(path)


def _recognise(path: Path, head: bytes) -> str | None:
    """Name of the first format whose mark fits; None where none does."""
    for by_path in PATHS:
        if by_path.sniff(path, head):
            return by_path.name
    for by_bytes in BYTES:
        if by_bytes.sniff(head):
            return by_bytes.name
    return None


@contextlib.contextmanager
def converted_first(path: str | Path, time: str = "time_ns") -> Iterator[None]:
    """Within it, an error of reading a table is one about a raw log, where the file is one.

    Args:
        path: the file that is read as a table.
        time: name of its column of times; a file with it in its first line is a table, however bad.

    Raises:
        DataError: naming format and command for a raw log; else the error itself.
    """
    try:
        yield
    except DataError as error:
        place = Path(path)
        if not place.is_file():
            raise
        head = _head(place)
        name = _recognise(place, head)
        if name in {None, table.NAME} or time.encode() in head.split(b"\n", 1)[0]:
            raise
        raise DataError(
            f"is a log of format {name}, not a table",
            place=place,
            hint=(f"convert it first: bottomlock convert {place} --out {place.with_suffix('.parquet').name}"),
        ) from error


def utf8(data: bytes) -> bytes:
    """Text in UTF-16, or that begins with a byte order mark, as UTF-8 without it; other bytes as they are.

    >>> [utf8("t,x".encode(name)) for name in ("utf-16", "utf-16-le", "utf-16-be", "utf-8-sig")]
    [b't,x', b't,x', b't,x', b't,x']
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", "ignore").encode()
    # Without a mark every second byte of what names columns is zero, and no other one.
    head = data[:64]
    for name, low in (("utf-16-le", 0), ("utf-16-be", 1)):
        if len(head) > 1 and all(head[low::2]) and not any(head[1 - low :: 2]):
            return data.decode(name, "ignore").encode()
    return data.removeprefix(codecs.BOM_UTF8)


def _objects_in_lines(data: bytes) -> bytes:
    """An array of JSON with an object a line, as a log has them; other bytes as they are."""
    if not data[:64].lstrip().startswith(b"["):
        return data
    try:
        records = json.loads(data)
    except ValueError:
        return data
    return b"".join(json.dumps(one).encode() + b"\n" for one in records)


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return utf8(stream.read(_HEAD))
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path) from error


def read_recording(path: str | Path, *, format: str | None = None, options: Options = PLAIN) -> Recording:  # noqa: A002
    """Reads the pings of a recorded file of any format.

    Args:
        path: the file, or the folder of a ROS 2 bag.
        format: one of `NAMES`; detected from the content by default, and "table" with a column map.
        options: settings of the readers.

    Raises:
        DataError: for a file that cannot be read, an unknown format, or a file without pings: naming the file and
            what was found instead.
        ScenarioError: for a bad column map.
    """
    place = Path(path)
    if format is not None and format not in NAMES:
        hint = did_you_mean(format, NAMES) or ","
        raise DataError(f"is '{format}'{hint} expected one of {', '.join(NAMES)}", key="--format")
    _check_there(place)
    name = format or (table.NAME if options.columns is not None else detect(place))
    try:
        return _read_as(place, name, options)
    except DataError as error:
        looks = None if format is None or place.is_dir() else _recognise(place, _head(place))
        if looks in {None, format} or error.hint:
            raise
        found = str(error).removeprefix(f"{place}: ")
        hint = f"it looks like a log of format {looks}: leave --format out"
        raise DataError(found, place=place, hint=hint) from error


def _read_as(place: Path, name: str, options: Options) -> Recording:
    """The pings of a file that is there, in a format of `NAMES`."""
    for by_path in PATHS:
        if by_path.name == name:
            return by_path.read(place, str(place), options)
    (by_bytes,) = (one for one in BYTES if one.name == name)
    if place.is_dir():
        raise DataError("is a folder", place=place, expected="a file")
    return by_bytes.read(_objects_in_lines(utf8(content(place, _TIMES_ITS_SIZE))), str(place), options)
