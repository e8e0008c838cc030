"""Reads tables from files of a user, Parquet or CSV: what a damaged file does to the library ends here, in one line.

The counts of a Parquet file stand in it several times: rows of the file, of each row group, values of each column chunk
and of each page. They must agree, and every chunk and page must lie within the file. Values are not looked at.

Source: Apache Parquet format, `parquet.thrift` (numbers of fields below), and the Thrift compact protocol.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import stat
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from bottomlock.errors import DataError
from bottomlock.libraries import pl

_MAGIC = b"PAR1"
_DEEPEST = 32
_LONGEST_HEADER = 1 << 20
_TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _LIST, _SET, _STRUCT = 1, 2, 3, 7, 8, 9, 10, 12
_INTEGERS = {4, 5, 6}
_DATA_PAGE, _DICTIONARY_PAGE, _DATA_PAGE_V2 = 0, 2, 3
_REPEATED = 2
_TEXTS = {6, 7}
_NUMBER_BYTES, _TEXT_BYTES = 20.0, 40.0
"""Memory that a value takes with its copies, however few bytes it has in the file (measured of a number: 16)."""


class _DamagedError(Exception):
    """Why the frame is not sound."""


class _Thrift:
    """Reads values of the compact protocol from bytes, within `at` and `end`."""

    def __init__(self, data: mmap.mmap, at: int, end: int) -> None:
        self.data, self.at, self.end = data, at, end

    def byte(self) -> int:
        if not self.at < self.end:
            raise _DamagedError("its metadata are cut off")
        self.at += 1
        return self.data[self.at - 1]

    def varint(self) -> int:
        value = 0
        for shift in range(0, 70, 7):
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise _DamagedError("a number in its metadata is too long")

    def integer(self) -> int:
        value = self.varint()
        return value >> 1 ^ -(value & 1)

    def size(self) -> int:
        """Length of what follows, a byte an entry at least."""
        size = self.varint()
        if size > self.end - self.at:
            raise _DamagedError("a length in its metadata is too large")
        return size

    def value(self, kind: int, depth: int) -> Any:  # noqa: ANN401 - integers, bytes, lists and structures
        if depth > _DEEPEST:
            raise _DamagedError("its metadata are nested too deeply")
        if kind in _INTEGERS:
            return self.integer()
        if kind in {_TRUE, _FALSE, _BYTE}:
            return self.byte()
        if kind in {_DOUBLE, _BINARY}:
            size = 8 if kind == _DOUBLE else self.size()
            if size > self.end - self.at:
                raise _DamagedError("its metadata are cut off")
            self.at += size
            return self.data[self.at - size : self.at]
        if kind in {_LIST, _SET}:
            head = self.byte()
            size = head >> 4
            if size == 15:
                size = self.size()
            return [self.value(head & 15, depth + 1) for _ in range(size)]
        if kind == _STRUCT:
            return self.structure(depth + 1)
        raise _DamagedError("its metadata hold an unknown type")

    def structure(self, depth: int = 0) -> dict[int, Any]:
        """A structure by the numbers of its fields."""
        found: dict[int, Any] = {}
        number = 0
        while head := self.byte():
            kind = head & 15
            number = number + (head >> 4) if head >> 4 else self.integer()
            found[number] = kind == _TRUE if kind in {_TRUE, _FALSE} else self.value(kind, depth)
        return found


def check_parquet(path: Path) -> float:
    """Checks that the counts in a Parquet file agree and lie within it; about the bytes that reading it takes.

    Raises:
        DataError: naming the file, for one that is not Parquet, is cut off, or whose counts do not agree.
    """
    try:
        with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _check(data)
    except _DamagedError as error:
        raise DataError(f"is damaged or not Parquet ({error})", place=path) from error
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read ({error})", place=path) from error
    except (KeyError, TypeError, AttributeError) as error:
        raise DataError("is damaged or not Parquet (its metadata lack a field)", place=path) from error


def _check(data: mmap.mmap) -> float:
    size = len(data)
    if size < 12 or data[:4] != _MAGIC or data[-4:] != _MAGIC:
        raise _DamagedError("it does not begin and end with PAR1")
    length = int.from_bytes(data[-8:-4], "little")
    if length > size - 12:
        raise _DamagedError("its metadata are longer than the file")
    start = size - 8 - length
    # FileMetaData: 2 schema, 3 rows, 4 row groups. SchemaElement: 3 repetition, 5 children.
    meta = _Thrift(data, start, size - 8).structure()
    leaves = [one for one in meta[2] if not one.get(5)]
    flat = not any(one.get(3) == _REPEATED for one in meta[2])
    groups = meta.get(4, [])
    _equal("rows", meta[3], sum(group[3] for group in groups))
    needed_bytes = 0.0
    for group in groups:
        # RowGroup: 1 columns, 3 rows. ColumnChunk: 3 metadata, of them 1 type.
        _equal("columns", len(group[1]), len(leaves))
        for chunk in group[1]:
            if flat:
                _equal("rows of a column", group[3], chunk[3][5])
            _check_chunk(data, chunk[3], start)
            needed_bytes += chunk[3][5] * (_TEXT_BYTES if chunk[3][1] in _TEXTS else _NUMBER_BYTES)
    return needed_bytes


def _check_chunk(data: mmap.mmap, chunk: dict[int, Any], limit: int) -> None:
    """Walks the pages of a column chunk. ColumnMetaData: 5 values, 7 bytes, 9 first data page, 11 dictionary."""
    at = chunk[9] if not chunk.get(11) else min(chunk[9], chunk[11])
    end = at + chunk[7]
    if not (4 <= at <= end <= limit and 4 <= chunk[9] <= limit):
        raise _DamagedError("a column lies outside of the file")
    values = 0
    while at < end:
        reader = _Thrift(data, at, min(end, at + _LONGEST_HEADER))
        # PageHeader: 1 type, 2 size unpacked, 3 size, 5 data page, 7 dictionary, 8 data page v2; in each 1 values.
        page = reader.structure()
        at = reader.at + page[3]
        if page[2] < 0 or page[3] < 0 or at > end:
            raise _DamagedError("a page lies outside of its column")
        if page[1] == _DICTIONARY_PAGE:
            if not 0 <= page[7][1] <= page[2]:
                raise _DamagedError("a dictionary states more entries than it has bytes")
        elif page[1] in {_DATA_PAGE, _DATA_PAGE_V2}:
            header = page[5] if page[1] == _DATA_PAGE else page[8]
            values += header[1]
            if header[1] < 0:
                raise _DamagedError("a page states fewer values than none")
            if page[1] == _DATA_PAGE_V2 and not 0 <= header[5] + header[6] <= page[3]:
                raise _DamagedError("the levels of a page are longer than it")
    _equal("values of a column", chunk[5], values)


def _equal(what: str, stated: int, found: int) -> None:
    if stated != found or stated < 0:
        raise _DamagedError(f"it states {stated} {what} and holds {found}")


_PARQUET = {".parquet", ".pq"}
_TIMES_ITS_SIZE = 7.0
"""Memory that reading a text takes, over its size (measured: 5.3 and what the interpreter holds)."""


def check_regular(path: Path) -> None:
    """Checks that a path is a file that ends.

    Raises:
        DataError: for a missing file, a folder, a pipe or a device.
    """
    try:
        mode = path.stat().st_mode
    except FileNotFoundError as error:
        raise DataError("no such file", place=path) from error
    except (OSError, ValueError) as error:
        raise DataError(
            f"cannot be read ({getattr(error, 'strerror', None) or error})", place=path
        ) from error
    if stat.S_ISDIR(mode):
        raise DataError("is a folder", place=path, expected="a file")
    if not stat.S_ISREG(mode):
        raise DataError(
            "is a pipe or a device", place=path, expected="a file", hint="save the data to a file first"
        )


def check_memory(path: Path | str, needed_bytes: float) -> None:
    """Checks that what is to be read fits into the memory: where it does not, the system may end the program instead.

    Args:
        path: what is read.
        needed_bytes: about what reading takes.

    Raises:
        DataError: where less is available.
    """
    available = available_memory_bytes()
    if needed_bytes > available:
        raise DataError(
            f"reading it takes about {needed_bytes / 1000000000.0:.1f} GB of memory, and "
            f"{available / 1000000000.0:.1f} GB are available",
            place=path,
            hint="cut it into parts of a dive each, or use a machine with more",
        )


def content(path: Path, times_its_size: float) -> bytes:
    """The bytes of a file, if reading it takes no more memory than there is.

    Args:
        path: the file.
        times_its_size: memory that its reader takes, over its size.

    Raises:
        DataError: where it cannot be read, or is too large for the memory.
    """
    try:
        check_memory(path, times_its_size * path.stat().st_size)
        return path.read_bytes()
    except OSError as error:
        raise DataError(f"cannot be read ({error.strerror or error})", place=path) from error


def available_memory_bytes() -> float:
    """Memory that this process may still take: the machine's, its container's or its own limit; infinite if unknown."""
    bounds = [math.inf]
    with contextlib.suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        bounds += [1024.0 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable:")]
    with contextlib.suppress(OSError, ValueError):
        group = Path("/sys/fs/cgroup")
        stated = (group / "memory.stat").read_text(encoding="ascii").splitlines()
        taken = {name: float(value) for name, value in (line.split() for line in stated)}
        bounds.append(float((group / "memory.max").read_text(encoding="ascii")) - taken.get("anon", 0.0))
    with contextlib.suppress(ImportError, OSError, ValueError, IndexError):
        import resource  # noqa: PLC0415 - not on Windows

        limit = float(resource.getrlimit(resource.RLIMIT_AS)[0])
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        if limit > 0.0 and limit != float(resource.RLIM_INFINITY):
            bounds.append(limit - float(pages * resource.getpagesize()))
    return max(min(bounds), 0.0)


def read_table_file(path: Path) -> pl.DataFrame:
    """CSV (as text) or Parquet as a table.

    Raises:
        DataError: for what is not a file, or cannot be read.
    """
    if path.suffix.lower() in _PARQUET:
        return read_parquet(path)
    check_regular(path)
    check_memory(path, _TIMES_ITS_SIZE * path.stat().st_size)
    # Text first: a number that cannot be read is then reported with its row, not dropped.
    return _read(path, lambda: pl.read_csv(path, infer_schema=False, glob=False))


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> pl.DataFrame:
    """A Parquet file, or some of its columns.

    Raises:
        DataError: for what is not a file, or cannot be read: damaged, cut off, or without a column.
    """

    def read() -> pl.DataFrame:
        check_memory(path, check_parquet(path))
        return pl.read_parquet(path, columns=None if columns is None else list(columns), glob=False)

    return _read(path, read)


def _read(path: Path, read: Callable[[], pl.DataFrame]) -> pl.DataFrame:
    check_regular(path)
    try:
        with _silent():
            return read()
    except DataError:
        raise
    # A damaged file makes the library raise anything, also a panic, which is no Exception.
    except (Exception, pl.exceptions.PanicException) as error:
        text = str(error).strip() or type(error).__name__
        raise DataError(f"cannot be read ({text.splitlines()[0][:200]})", place=path) from error


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    """Without the trace that a panic in compiled code writes to the standard error, past Python."""
    try:
        kept, sink = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    except OSError:
        yield
        return
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(sink)
