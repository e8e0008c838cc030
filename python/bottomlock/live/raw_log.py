"""The raw log: every byte with its time of arrival, and every byte that was sent, as MCAP without chunks.

Without chunks a record is in the file as soon as it is written, so a log that ends in the middle of a record, after a
kill or a loss of power, is read up to there. Messages count from 1, so that a damaged length or kind of a record, which
would hide what follows, is told from such an end. Topics: `in/<source>`, `connected/<source>`, `out/<place>/<port>`,
and `paused/host`, whose bytes are the ns for which the process did not run.
"""

import contextlib
import io
import mmap
import struct
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, get_args

from bottomlock.errors import DataError, OutputError
from bottomlock.libraries import install

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
    """The library mcap, with its writer, its records and its exceptions.

    Raises:
        DataError: where it is not installed.
    """
    try:
        import mcap.writer  # noqa: PLC0415 - an extra; it imports records, streams and exceptions
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
            OutputError: where the disk is full or gone; the log has ended then.
        """
        try:
            self._messages = (self._messages + 1) % _NUMBERS
            self._writer.add_message(self._channels[kind, place], time_ns, data, time_ns, self._messages)
        except OSError as error:
            with contextlib.suppress(OSError):
                self._file.close()  # as it is, without an end: the log is one that was cut off
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


class ReadLog:
    """A raw log that is read up to its end, or to where it was cut off or damaged.

    Attributes:
        start: what the engine started from.
        end: where and why it ends before the end of the file, once its entries have been read; "" if it was closed.
        damaged: whether that is damage. A kill leaves a log that was cut off.

    Raises:
        DataError: for a file that cannot be read or is no raw log of ours, and where mcap is not installed.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._mcap = path, mcap_library()
        self.start: dict[str, bytes] = {}
        self._channels: dict[int, tuple[Kind, int]] = {}
        self.end, self.damaged = "", False
        try:
            with path.open("rb") as file:
                self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise DataError(
                f"cannot be read ({getattr(error, 'strerror', None) or error})", place=path
            ) from error
        # What stands before the messages.
        next(self.entries(), None)
        if not self._channels:
            raise DataError("has no channels", place=path, expected="a raw log of `bottomlock live`")

    def entries(self) -> Iterator[Entry]:
        """The entries in the order in which they were written."""
        for kind, record in self._records():
            try:
                if kind == _KINDS["attachment"]:
                    attached = self._mcap.records.Attachment.read(self._stream(record))
                    self.start[attached.name.removeprefix(f"{START}/")] = attached.data
                elif kind == _KINDS["channel"]:
                    self._add_channel(self._mcap.records.Channel.read(self._stream(record)))
                elif kind == _KINDS["message"]:
                    channel, _, time_ns, _ = _MESSAGE.unpack_from(record)
                    yield Entry(*self._channels[channel], time_ns, record[_MESSAGE.size :])
            except (struct.error, UnicodeDecodeError, KeyError, self._mcap.exceptions.McapError) as error:
                raise DataError(f"is no raw log, or damaged ({error!r})", place=self._path) from error

    def _stream(self, record: bytes) -> Any:  # noqa: ANN401 - of the library
        return self._mcap.data_stream.ReadDataStream(io.BytesIO(record))

    def _add_channel(self, channel: Any) -> None:  # noqa: ANN401 - of the library
        kind, place = channel.metadata.get("kind"), channel.metadata.get("place", "")
        if kind not in get_args(Kind) or not place.isdigit():
            raise DataError(
                f"channel '{channel.topic}' is none of a raw log of `bottomlock live`", place=self._path
            )
        self._channels[channel.id] = kind, int(place)

    def _records(self) -> Iterator[tuple[int, bytes]]:
        """Kind and content of the records."""
        data, at, last = self._data, _MAGIC_BYTES, 0
        while at + _RECORD.size <= len(data):
            kind, length = _RECORD.unpack_from(data, at)
            begin, follows = at + _RECORD.size, at + _RECORD.size + length
            if kind == _KINDS["data end"]:
                return
            why = "" if kind in _KINDS.values() else f"a record of kind {kind}"
            if kind == _KINDS["message"] and follows <= len(data):
                number = _MESSAGE.unpack_from(data, begin)[1] if length >= _MESSAGE.size else -1
                # Logs of earlier versions have no numbers.
                if number != (last + 1) % _NUMBERS and (number or last):
                    why = f"message {number} after {last}"
                last = number
            if follows > len(data) and self._goes_on(at, last):
                why = why or f"a record of {length} bytes"
            if why:
                self.end, self.damaged = f"damaged at byte {at} of {len(data)}: {why}", True
                return
            if follows > len(data):
                break
            yield kind, data[begin:follows]
            at = follows
        self.end = f"cut off at byte {at} of {len(data)}, in the middle of a record"

    def _goes_on(self, at: int, last: int) -> bool:
        """Whether a message follows one that seems to be the last, so that its length cannot be right."""
        data = self._data
        while (at := data.find(struct.pack("<I", (last + 2) % _NUMBERS), at + 1)) >= 0:
            begin = at - _RECORD.size - 2
            kind, length = _RECORD.unpack_from(data, begin)
            if kind == _KINDS["message"] and _MESSAGE.size <= length <= len(data) - begin - _RECORD.size:
                return True
        return False
