"""Binary records behind false starts: headers are found, tested and read for the whole file at once."""

from collections.abc import Iterator
from dataclasses import dataclass
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
        chosen = []
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
        return np.array(chosen, dtype=np.int64)
