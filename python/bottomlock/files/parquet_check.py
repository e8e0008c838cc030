"""Checks the frame of a Parquet file before a library reads it: a damaged count there ends the process, not the call.

The counts of a file stand in it several times: rows of the file, of each row group, values of each column chunk and of
each page. They must agree, and every chunk and page must lie within the file. Values are not looked at.

Source: Apache Parquet format, `parquet.thrift` (numbers of fields below), and the Thrift compact protocol.
"""

import mmap
from pathlib import Path
from typing import Any

from bottomlock.errors import DataError

_MAGIC = b"PAR1"
_DEEPEST = 32
_LONGEST_HEADER = 1 << 20
_TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _LIST, _SET, _STRUCT = 1, 2, 3, 7, 8, 9, 10, 12
_INTEGERS = {4, 5, 6}
_DATA_PAGE, _DICTIONARY_PAGE, _DATA_PAGE_V2 = 0, 2, 3
_REPEATED = 2


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


def check_parquet(path: Path) -> None:
    """Checks that the counts in a Parquet file agree and lie within it.

    Raises:
        DataError: naming the file, for one that is not Parquet, is cut off, or whose counts do not agree.
    """
    try:
        with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            _check(data)
    except _DamagedError as error:
        raise DataError(f"is damaged or not Parquet ({error})", place=path) from error
    except (OSError, ValueError) as error:
        raise DataError(f"cannot be read ({error})", place=path) from error
    except (KeyError, TypeError, AttributeError) as error:
        raise DataError("is damaged or not Parquet (its metadata lack a field)", place=path) from error


def _check(data: mmap.mmap) -> None:
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
    for group in groups:
        # RowGroup: 1 columns, 3 rows. ColumnChunk: 3 metadata.
        _equal("columns", len(group[1]), len(leaves))
        for chunk in group[1]:
            if flat:
                _equal("rows of a column", group[3], chunk[3][5])
            _check_chunk(data, chunk[3], start)


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
