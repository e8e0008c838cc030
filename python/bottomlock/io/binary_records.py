"""Binary records behind false starts: headers are found, tested and read for the whole file at once."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account, Flags, Integers
from bottomlock.io.progress import reporter

BLOCK = 1 << 17
"""Bytes that are searched for headers at a time: what is found in them fits into a processor's cache."""

EMPTY = "without fixed or variable leader"
"""Reason for a whole ensemble without what a ping needs."""

Places = NDArray[np.int64]
_WORD = np.dtype("<u2")


def blocks(length: int) -> Iterator[int]:
    """Where each block of a file begins; tells how far the search is."""
    report = reporter()
    for block in range(0, length, BLOCK):
        if block and report is not None:
            report(block)
        yield block


def bytes_of(data: bytes) -> NDArray[np.uint8]:
    """The bytes as an array, without a copy."""
    return np.frombuffer(data, dtype=np.uint8)


def words_at(data: bytes, at: Places) -> Places:
    """Little-endian 16-bit words at some places."""
    return fields_at(data, at, _WORD).astype(np.int64)


def numbered(count: Places) -> tuple[Places, Places]:
    """Of the parts of some records, the record and the number within it.

    >>> [one.tolist() for one in numbered(np.array([2, 0, 3]))]
    [[0, 0, 2, 2, 2], [0, 1, 0, 1, 2]]
    """
    owner = np.arange(len(count)).repeat(count)
    return owner, np.arange(len(owner)) - (count.cumsum() - count).repeat(count)


def every(data: bytes, layout: np.dtype[Any] = _WORD) -> NDArray[Any]:
    """Words, or the fields of a layout, at every place that has so many bytes, without a copy."""
    return np.ndarray((max(len(data) - layout.itemsize + 1, 0),), dtype=layout, buffer=data, strides=(1,))


def fields_at(data: bytes, at: Places, layout: np.dtype[Any]) -> NDArray[Any]:
    """(n,) structured: the fields of a layout at some places, all of it within the data."""
    if not len(at):
        return np.empty(0, dtype=layout)
    if len(at) == 1:  # a record of a stream: five times faster
        return np.frombuffer(data, layout, 1, int(at[0]))
    return np.asarray(every(data, layout)[at])


def sums_fit(data: bytes, start: Places, last: Places) -> Flags:
    """(n,) whether pieces are whole, with the 16-bit sum of their bytes behind them; each byte is summed once."""
    sums = np.zeros(len(data) + 1, dtype=np.uint16)
    np.cumsum(bytes_of(data), dtype=np.uint16, out=sums[1:])
    whole = last + 2 <= len(data)
    whole[whole] = sums[last[whole]] - sums[start[whole]] == words_at(data, last[whole])
    return whole


def search(
    data: bytes,
    mark: bytes,
    least: int,
    limits: Mapping[int, tuple[int, int]],
    sound: Callable[[Places], Flags],
) -> Places:
    """Places of headers of so many bytes or more, by their mark, the limits of their n-th bytes, and a further test."""
    raw, found = bytes_of(data), [np.empty(0, dtype=np.int64)]
    for block in blocks(max(len(raw) - least + 1, 0)):
        part = raw[block : block + BLOCK + least - 1]
        end = len(part) - least + 1
        marked = part[:end] == mark[0]
        for n in range(1, len(mark)):
            marked &= part[n : n + end] == mark[n]
        for n, (low, high) in limits.items():
            # What is below the lower limit wraps round to a great number.
            marked &= part[n : n + end] - np.uint8(low) <= high - low
        at = marked.nonzero()[0] + block
        found.append(at[sound(at)])
    return np.concatenate(found)


_MONTHS, _DAYS, _THIS_AND_NEXT = np.dtype("datetime64[M]"), np.dtype("datetime64[D]"), np.array([[0], [1]])


def calendar_ns(fields: Integers, part_ns: Integers) -> tuple[Integers, Flags]:
    """Times since 1970, ns, and which of them a calendar and a clock can show.

    Args:
        fields: (n, 6) year, month, day, hour, minute, second; columns after them are not read.
        part_ns: (n,) of the second.

    >>> found, good = calendar_ns(np.array([[1970, 1, 2, 0, 1, 2], [2024, 2, 30, 0, 0, 0]]), np.array([3, 0]))
    >>> found[0], good.tolist()
    (np.int64(86462000000003), [True, False])
    """
    year, month, day, hour, minute, second = fields.T[:6]
    first, after = (
        ((year - 1970) * 12 + month - 1 + _THIS_AND_NEXT).astype(_MONTHS).astype(_DAYS).astype(np.int64)
    )
    good = (month >= 1) & (month <= 12) & (day >= 1) & (day <= after - first)
    good &= (hour <= 23) & (minute <= 59) & (second <= 60) & (part_ns < 1_000_000_000)
    return (((first + day - 1) * 24 + hour) * 3600 + minute * 60 + second) * 1_000_000_000 + part_ns, good


@dataclass(frozen=True, eq=False)
class Headers:
    """Every place where a header stands, rising.

    Attributes:
        start: (n,) where the record begins.
        end: (n,) where it ends, perhaps behind the file.
        fits: (n,) it is whole, and its checksum fits.
        empty: (n,) it is too short for anything of use.
    """

    start: Places
    end: Places
    fits: NDArray[np.bool_]
    empty: NDArray[np.bool_]

    def whole(self, length: int, account: Account, what: str) -> tuple[Places, Places]:
        """Where whole records begin and end; what is damaged, empty, cut off or between them is counted.

        A damaged record does not hide the next: bytes may be missing from it, so that the next begins within it.

        Args:
            length: of the file, bytes.
            account: for the counts; whole records are counted as read.
            what: a record's name.
        """
        chosen: list[int] = []
        behind = reach = 0  # the last whole record, and all that is counted
        columns = (self.start, self.end, self.fits, self.empty)
        for k, (start, end, fits, empty) in enumerate(zip(*(each.tolist() for each in columns), strict=True)):
            if start < behind:
                continue
            if start > reach:
                account.skip(f"bytes that belong to no {what}", reach, f"{start - reach} bytes")
            account.read += 1
            if fits and not empty:
                chosen.append(k)
                behind = reach = end
                continue
            if end > length:
                account.skip("truncated", start, f"{length - start} of {end - start} bytes")
            else:
                account.skip(EMPTY if fits else "bad checksum", start, f"{end - start} bytes")
            reach = max(reach, min(end, length))
        if reach < length:
            account.skip(f"bytes that belong to no {what}", reach, f"{length - reach} bytes")
        return self.start[chosen], self.end[chosen]


class Found(NamedTuple):
    """Whole records of some bytes: where each begins and ends, and the account of what else there is."""

    data: bytes
    start: Places
    end: Places
    account: Account


@dataclass(frozen=True)
class Records:
    """Records of one kind of framing.

    Attributes:
        mark: with which every header begins.
        headers: finds every header in some bytes.
        longest: bytes of the longest header.
        what: a record's name.
    """

    mark: bytes
    headers: Callable[[bytes], Headers]
    longest: int
    what: str

    def of(self, data: bytes) -> Found:
        """The whole records of a file."""
        account = Account(unit="byte")
        return Found(data, *self.headers(data).whole(len(data), account, self.what), account)
