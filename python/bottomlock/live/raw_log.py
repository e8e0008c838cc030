"""The raw log: every byte with its time of arrival, and every byte that was sent, as MCAP without chunks.

Without chunks a record is in the file as soon as it is written, so a log that ends in the middle of a record, after a
kill or a loss of power, is read up to there. Messages count from 1, so that a damaged length or kind of a record, which
would hide what follows, is told from such an end. Topics: `in/<source>`, `connected/<source>`, `out/<place>/<port>`,
and `paused/host`, whose bytes are the ns for which the process did not run.
"""

import contextlib
import mmap
import struct
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, get_args

from bottomlock.errors import DataError, OutputError
from bottomlock.support.extras import install

Kind = Literal["in", "connected", "out", "paused"]
_RECORD, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""Kind and length of a record; channel, number and two times of a message."""
_KINDS = {"header": 1, "footer": 2, "channel": 4, "message": 5, "attachment": 9, "data end": 15}
_MAGIC_BYTES = 8
_NUMBERS = 2**32
"""Numbers of messages, which begin again at 0."""
START = "start"
"""Name of the attachment that holds what the engine started from."""


@dataclass(frozen=True)
class Entry:
    """An entry of a raw log: bytes of a source, a connection of it, bytes to a port, or a pause of the process.

    `place` is that of source or port in the configuration.
    """

    kind: Kind
    place: int
    time_ns: int
    data: bytes


def mcap_library() -> Any:  # noqa: ANN401 - an extra
    """The library mcap, with its writer.

    Raises:
        DataError: where it is not installed.
    """
    try:
        import mcap.writer  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise DataError(f"raw logs and MCAP files need mcap: {install('live')}") from error
    return mcap


class RawLog:
    """A raw log that is being written.

    Args:
        folder: where; the file is named after the time.
        sources: names of the sources.
        ports: names of the ports.
        start: what the engine started from: the text of the configuration and, after a restart, its checkpoint.

    Raises:
        DataError: where mcap is not installed.
        OutputError: where the file cannot be written.
    """

    def __init__(
        self, folder: Path, *, sources: Sequence[str], ports: Sequence[str], start: dict[str, bytes]
    ) -> None:
        mcap = mcap_library()
        name = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.path, self._file = _new_file(folder, name)
        except OSError as error:
            raise OutputError(
                f"no raw log can be written ({error.strerror or error})", place=folder
            ) from error
        self._writer = mcap.writer.Writer(
            self._file,
            use_chunking=False,
            index_types=mcap.writer.IndexType.NONE,
            compression=mcap.writer.CompressionType.NONE,
            enable_crcs=False,
        )
        self._writer.start(profile="", library="bottomlock")
        for key, content in start.items():
            self._writer.add_attachment(0, 0, f"{START}/{key}", "application/octet-stream", content)
        self._channels: dict[tuple[Kind, int], int] = {}
        topics: list[tuple[Kind, int, str]] = [
            *(("in", place, f"in/{name}") for place, name in enumerate(sources)),
            *(("connected", place, f"connected/{name}") for place, name in enumerate(sources)),
            *(("out", place, f"out/{place}/{name}") for place, name in enumerate(ports)),
            ("paused", 0, "paused/host"),
        ]
        for kind, place, topic in topics:
            self._channels[kind, place] = self._writer.register_channel(
                topic, "application/octet-stream", 0, {"kind": kind, "place": str(place)}
            )
        self.bytes = self._messages = 0
        self.flush()

    def write(self, kind: Kind, place: int, time_ns: int, data: bytes) -> None:
        """Writes an entry; times never fall.

        Raises:
            OutputError: where the disk is full or gone.
        """
        try:
            self._messages = (self._messages + 1) % _NUMBERS
            self._writer.add_message(self._channels[kind, place], time_ns, data, time_ns, self._messages)
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror or error})", place=self.path) from error
        self.bytes += len(data)

    def flush(self) -> None:
        """Hands everything to the system: it survives the end of the process.

        Raises:
            OutputError: where the disk is full or gone.
        """
        try:
            self._file.flush()
        except OSError as error:
            raise OutputError(f"cannot be written ({error.strerror or error})", place=self.path) from error

    def close(self) -> None:
        """Ends the file."""
        with contextlib.suppress(OSError):
            self._writer.finish()
            self._file.close()


def _new_file(folder: Path, name: str) -> tuple[Path, IO[bytes]]:
    """A file of this name or, where there is one, with a number behind it."""
    for number in range(1000):
        path = folder / (f"{name}.mcap" if not number else f"{name}_{number}.mcap")
        with contextlib.suppress(FileExistsError):
            return path, path.open("xb")
    raise OSError(f"{folder} has a thousand files named {name}")


@dataclass(frozen=True)
class ReadLog:
    """A raw log that is read.

    Attributes:
        start: what the engine started from.
        entries: in the order in which they were written, up to where the log ends or is damaged.
        end: where and why it ends before the end of the file; "" for one that was closed.
        damaged: whether that is damage. A kill leaves a log that was cut off.
    """

    start: dict[str, bytes]
    entries: Iterator[Entry]
    end: str
    damaged: bool


def read_raw_log(path: Path) -> ReadLog:
    """Reads a raw log; one that was cut off is read up to there.

    Raises:
        DataError: for a file that cannot be read or is no raw log of ours.
    """
    mcap_library()
    try:
        file = path.open("rb")
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path) from error
    end, damaged, sound = _end_of(path)
    start: dict[str, bytes] = {}
    records = _records(path, file, sound)
    for kind, record in records:
        if kind == "Attachment":
            start[record.name.removeprefix(f"{START}/")] = record.data
        elif kind == "Channel":
            return ReadLog(start, _entries(path, record, records), end, damaged)
    raise DataError("has no channels", place=path, expected="a raw log of `bottomlock live`")


def _end_of(path: Path) -> tuple[str, bool, int]:
    """Where and why a log ends, "" where it was closed; whether it is damaged; the bytes before that."""
    if path.stat().st_size <= _MAGIC_BYTES:
        return "", False, path.stat().st_size
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        at, last = _MAGIC_BYTES, 0
        while at + _RECORD.size <= len(data):
            kind, length = _RECORD.unpack_from(data, at)
            if kind == _KINDS["data end"]:
                return "", False, len(data)
            follows = at + _RECORD.size + length
            why = "" if kind in _KINDS.values() else f"a record of kind {kind}"
            if kind == _KINDS["message"] and not why and follows <= len(data):
                number = _MESSAGE.unpack_from(data, at + _RECORD.size)[1] if length >= _MESSAGE.size else -1
                # Logs of earlier versions have no numbers.
                if number != (last + 1) % _NUMBERS and (number or last):
                    why = f"message {number} after {last}"
                last = number
            if why or (follows > len(data) and _goes_on(data, at, last)):
                why = why or f"a record of {length} bytes"
                return f"damaged at byte {at} of {len(data)}: {why}", True, at
            if follows > len(data):
                break
            at = follows
        return f"cut off at byte {at} of {len(data)}, in the middle of a record", False, at


def _goes_on(data: mmap.mmap, at: int, last: int) -> bool:
    """Whether a message follows one that seems to be the last, so that its length cannot be right."""
    place = at
    while (place := data.find(struct.pack("<I", (last + 2) % _NUMBERS), place + 1)) >= 0:
        begin = place - _RECORD.size - 2
        kind, length = _RECORD.unpack_from(data, begin)
        if kind == _KINDS["message"] and _MESSAGE.size <= length <= len(data) - begin - _RECORD.size:
            return True
    return False


def _records(path: Path, file: IO[bytes], sound: int) -> Iterator[tuple[str, Any]]:
    """The records of a file up to its end, or to where it was cut off or damaged: byte `sound`."""
    from mcap.exceptions import EndOfFile, McapError  # noqa: PLC0415 - an extra
    from mcap.stream_reader import StreamReader  # noqa: PLC0415

    class Whole:
        """The file; a read past its end raises, since the library takes half a message for one."""

        @staticmethod
        def read(size: int) -> bytes:
            data = file.read(size)
            if len(data) < size or file.tell() > sound:
                raise EndOfFile
            return data

    with file:
        try:
            for record in StreamReader(Whole()).records:
                yield type(record).__name__, record
        except EndOfFile:
            return
        except (McapError, ValueError, OSError, struct.error) as error:
            raise DataError(f"is no raw log, or damaged ({error})", place=path) from error


def _entries(path: Path, first: Any, records: Iterator[tuple[str, Any]]) -> Iterator[Entry]:  # noqa: ANN401
    channels: dict[int, tuple[Kind, int]] = {}

    def add(channel: Any) -> None:  # noqa: ANN401 - untyped library
        kind, place = channel.metadata.get("kind"), channel.metadata.get("place", "")
        if kind not in get_args(Kind) or not place.isdigit():
            raise DataError(
                f"channel '{channel.topic}' is none of a raw log of `bottomlock live`", place=path
            )
        channels[channel.id] = kind, int(place)

    add(first)
    for kind, record in records:
        if kind == "Channel":
            add(record)
        elif kind == "Message":
            yield Entry(*channels[record.channel_id], record.log_time, record.data)
