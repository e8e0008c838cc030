"""Binary records behind false starts: headers are found, tested and read for the whole file at once.

A run of sync bytes, or headers that overlap, cost some vector operations a byte, and no record is looked at singly.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account
from bottomlock.io.progress import reporter

BLOCK = 1 << 17
"""Bytes that are searched for headers at a time: what is found in them fits into a processor's cache."""

EMPTY = "without fixed or variable leader"
"""Reason for a whole ensemble without what a ping needs."""

Places = NDArray[np.int64]


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


def words_at(raw: NDArray[np.uint8], at: Places) -> Places:
    """Little-endian 16-bit words at some places."""
    return raw.take(at).astype(np.int64) | raw.take(at + 1).astype(np.int64) << 8


def numbered(count: Places) -> tuple[Places, Places]:
    """Of the parts of some records, the record and the number within it.

    >>> [one.tolist() for one in numbered(np.array([2, 0, 3]))]
    [[0, 0, 2, 2, 2], [0, 1, 0, 1, 2]]
    """
    owner = np.repeat(np.arange(len(count)), count)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)


def fields_at(data: bytes, at: Places, layout: np.dtype[Any]) -> NDArray[Any]:
    """(n,) structured: the fields of a layout at some places, all of it within the data."""
    if not len(at):
        return np.empty(0, dtype=layout)
    everywhere = np.ndarray((len(data) - layout.itemsize + 1,), dtype=layout, buffer=data, strides=(1,))
    return np.asarray(everywhere[at])


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

    def whole(self, length: int, account: Account, what: str) -> Places:
        """Indices of every record that is whole; what is damaged, empty, cut off or between them is counted.

        A damaged record does not hide the next: bytes may be missing from it, so that the next begins within it.

        Args:
            length: of the file, bytes.
            account: for the counts; whole records are counted as read.
            what: a record's name.
        """
        chosen = _one_after_another(self.start, self.end, np.flatnonzero(self.fits & ~self.empty))
        whole = np.zeros(len(self.start), dtype=bool)
        whole[chosen] = True
        after = np.cumsum(whole)  # how many are whole, up to each
        ends = np.concatenate(([0], self.end[chosen]))
        # Of the others those count that do not begin within a whole record.
        counts = whole | (self.start >= ends[after])
        seen, segment = np.flatnonzero(counts), after[counts]
        self._lost_bytes(seen, segment, ends, length, account, what)
        account.read += len(seen)
        cut = self.end > length
        for reason, those in (("truncated", cut), ("bad checksum", ~cut & ~self.fits), (EMPTY, self.fits)):
            account.skip_where(
                reason, those & counts & ~whole, self.start, partial(self._size, length=length, reason=reason)
            )
        return chosen

    def _size(self, k: int, *, length: int, reason: str) -> str:
        size = int(self.end[k] - self.start[k])
        return f"{length - int(self.start[k])} of {size} bytes" if reason == "truncated" else f"{size} bytes"

    def _lost_bytes(
        self, seen: Places, segment: Places, ends: Places, length: int, account: Account, what: str
    ) -> None:
        """Counts the runs of bytes before, between and after the records, whole and damaged.

        Args:
            seen: (n,) indices of the records, rising.
            segment: (n,) how many of them are whole, up to each.
            ends: where each segment begins: 0, and the end of every whole record.
            length: of the file, bytes.
            account: for the count.
            what: a record's name.
        """
        # The byte up to which all is counted, after each record: a damaged one reaches no further than the next whole.
        reach = np.maximum(ends[segment], np.minimum(self.end[seen], length))
        reach = np.maximum.accumulate(reach + segment * (length + 1)) - segment * (length + 1)
        before, start = np.concatenate(([0], reach)), np.append(self.start[seen], length)
        account.skip_where(
            f"bytes that belong to no {what}",
            start > before,
            before,
            lambda k: f"{start[k] - before[k]} bytes",
        )


def _one_after_another(start: Places, end: Places, index: Places) -> Places:
    """Of whole records those that do not begin within the one before, as a reader would meet them."""
    begins, stops = start[index], end[index]
    if (begins[1:] >= stops[:-1]).all():
        return index
    chosen, at = [], 0
    for k, begin, stop in zip(index.tolist(), begins.tolist(), stops.tolist(), strict=True):
        if begin >= at:
            chosen.append(k)
            at = stop
    return np.array(chosen, dtype=np.int64)
