"""Binary records behind false starts, cut from a file or a stream that comes in any pieces."""

import datetime as dt
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from bottomlock.io.account import Account
from bottomlock.io.framing import Framer
from bottomlock.io.progress import reporter

BLOCK = 1 << 17
"""Bytes of a file that are read at a time."""

_EPOCH = dt.date(1970, 1, 1).toordinal()


def blocks(length: int) -> Iterator[int]:
    """Where each block of a file begins; tells how far the search is."""
    report = reporter()
    for block in range(0, length, BLOCK):
        if block and report is not None:
            report(block)
        yield block


def word_at(data: bytes, at: int) -> int:
    """The little-endian 16-bit word at a place."""
    return int.from_bytes(data[at : at + 2], "little")


Fits = Callable[[int, int], bool]
"""Whether the checksum of what stands between two places of some bytes is right."""


def sum_fits(data: bytes) -> Fits:
    """Of pieces that end with the 16-bit sum of their other bytes; each byte is summed once."""
    sums = [0, *np.cumsum(np.frombuffer(data, np.uint8), dtype=np.int64).tolist()]
    return lambda start, end: (sums[end - 2] - sums[start]) & 0xFFFF == word_at(data, end - 2)


def calendar_ns(fields: list[int], part_ns: int) -> int | None:
    """A time since 1970, ns; None for one that no calendar and clock can show.

    Args:
        fields: year, month, day, hour, minute, second.
        part_ns: of the second.

    >>> calendar_ns([1970, 1, 2, 0, 1, 2], 3), calendar_ns([2024, 2, 30, 0, 0, 0], 0)
    (86462000000003, None)
    """
    year, month, day, hour, minute, second = fields
    try:
        days = dt.date(year, month, day).toordinal() - _EPOCH
    except ValueError:
        return None
    if hour > 23 or minute > 59 or second > 60 or part_ns >= 1_000_000_000:
        return None
    return ((days * 24 + hour) * 3600 + minute * 60 + second) * 1_000_000_000 + part_ns


@dataclass(frozen=True)
class Framing:
    """How one kind of records is cut.

    Attributes:
        mark: with which every header begins.
        what: a record's name.
        size: bytes of the record whose header stands at a place of some bytes; 0 where none stands there, None where
            more bytes are needed to tell.
        fits: makes the test of the checksums in some bytes.
    """

    mark: bytes
    what: str
    size: Callable[[bytes, int], int | None]
    fits: Callable[[bytes], Fits]

    def of(self, data: bytes) -> list[bytes]:
        """The whole records of some bytes."""
        return [record for _, record in Binary(self).records(data, Account(unit="byte"), last=True)]


class Binary(Framer):
    """Cuts records with a header that states their size, and a checksum; places count from the first byte.

    Every place where a header stands is followed up to the end that it states, so that neither a damaged record nor
    bytes that look like a header hide the next whole record. Of records that overlap, the one that ends first is taken.
    """

    def __init__(self, framing: Framing) -> None:
        super().__init__()
        self._framing = framing
        self._buffer, self._base, self._searched = b"", 0, 0
        self._open = OrderedDict[int, int]()
        """Begin and end of what may be a record, in order."""
        self._damaged: set[int] = set()
        self._reach = self._taken = 0
        """All before it is counted; bytes of whole records."""

    def records(self, data: bytes, account: Account, *, last: bool = False) -> list[tuple[int, bytes]]:
        """The records that `data` completes, with their places.

        Args:
            data: what comes next.
            account: takes what is damaged, cut off or between records; whole records are counted as read.
            last: no more comes.
        """
        self._buffer += data
        self._search(last=last)
        found, length = [], self._base + len(self._buffer)
        ready = [(end, start) for start, end in self._open.items() if end <= length]
        fits = self._framing.fits(self._buffer) if ready else None
        for end, start in sorted(ready):
            if fits is None or start not in self._open or start in self._damaged:
                continue
            begin, stop = start - self._base, end - self._base
            if fits(begin, stop):
                self._take(start, end, account)
                found.append((start, self._buffer[begin:stop]))
            else:
                self._damaged.add(start)
        while self._open and (last or next(iter(self._open)) in self._damaged):
            start, end = next(iter(self._open.items()))
            if end > length:
                self._lose(start, account, "truncated", f"{length - start} of {end - start} bytes", length)
            else:
                self._lose(start, account, "bad checksum", f"{end - start} bytes", length)
        if last:
            self._skip_to(length, account)
        keep = length if last else next(iter(self._open), self._searched)
        self._buffer, self._base = self._buffer[keep - self._base :], keep
        self.dropped = self._base - self._taken
        return found

    def _search(self, *, last: bool) -> None:
        """Finds the headers that have not been looked at."""
        mark, data = self._framing.mark, self._buffer
        at = self._searched - self._base
        while (at := data.find(mark, at)) >= 0:
            size = self._framing.size(data, at)
            if size is None and not last:
                self._searched = self._base + at
                return
            if size:
                self._open[self._base + at] = self._base + at + size
            at += 1
        self._searched = max(self._searched, self._base + len(data) - (0 if last else len(mark) - 1))

    def _take(self, start: int, end: int, account: Account) -> None:
        """Takes a whole record; what began before it and goes on is damaged."""
        while self._open and (first := next(iter(self._open))) < end:
            if first < start:
                what = f"{self._open[first] - first} bytes"
                self._lose(first, account, "bad checksum", what, start)
            else:
                del self._open[first]
                self._damaged.discard(first)
        self._skip_to(start, account)
        account.read += 1
        self._taken += end - start
        self._reach, self._searched = end, max(self._searched, end)

    def _lose(self, start: int, account: Account, why: str, detail: str, most: int) -> None:
        """Counts what is no whole record, up to a place at most."""
        end = self._open.pop(start)
        self._skip_to(start, account)
        account.read += 1
        account.skip(why, start, detail)
        self._damaged.discard(start)
        self._reach = max(self._reach, min(end, most))

    def _skip_to(self, at: int, account: Account) -> None:
        if at > self._reach:
            what = f"bytes that belong to no {self._framing.what}"
            account.skip(what, self._reach, f"{at - self._reach} bytes")
            self._reach = at

    def reset(self) -> None:
        """Drops a record that has begun."""
        self._base += len(self._buffer)
        self._buffer, self._searched, self._reach = b"", self._base, self._base
        self._open.clear()
        self._damaged.clear()
        self.dropped = self._base - self._taken
