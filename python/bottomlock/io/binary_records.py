"""Binary records behind false starts: headers are found and tested for the whole file at once, not byte by byte.

A run of sync bytes, or headers that overlap, cost a vector operation a byte; only whole records are looked at singly.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account
from bottomlock.io.progress import EVERY, reporter

BLOCK = 1 << 22
"""Bytes that are searched for headers at a time."""

EMPTY = "without fixed or variable leader"
"""Reason for a whole ensemble without what a ping needs."""

Places = NDArray[np.int64]


def bytes_of(data: bytes) -> NDArray[np.uint8]:
    """The bytes as an array, without a copy."""
    return np.frombuffer(data, dtype=np.uint8)


def words_at(raw: NDArray[np.uint8], at: Places) -> Places:
    """Little-endian 16-bit words at some places."""
    return raw.take(at).astype(np.int64) | raw.take(at + 1).astype(np.int64) << 8


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

    def whole(self, length: int, account: Account, what: str) -> Iterator[tuple[int, int]]:
        """Index and start of every record that is whole; what is damaged, empty, cut off or between them is counted.

        A damaged record does not hide the next: bytes may be missing from it, so that the next begins within it.

        Args:
            length: of the file, bytes.
            account: for the counts; whole records are counted as read.
            what: a record's name.
        """
        index = np.flatnonzero(self.fits & ~self.empty)
        report = reporter()
        at = counted = done = 0  # bytes before `counted` are in the account, and headers before `done`
        for k, start, end in zip(
            index.tolist(), self.start[index].tolist(), self.end[index].tolist(), strict=True
        ):
            if start < at:
                continue
            if done < k:
                counted = self._damaged(slice(done, k), at, counted, length, account, what)
            if start > counted:
                account.skip(f"bytes that belong to no {what}", counted, f"{start - counted} bytes")
            account.read += 1
            if report is not None and account.read % EVERY == 0:
                report(start)
            yield k, start
            at = counted = end
            done = k + 1
        counted = self._damaged(slice(done, len(self.start)), at, counted, length, account, what)
        if counted < length:
            account.skip(f"bytes that belong to no {what}", counted, f"{length - counted} bytes")

    def _damaged(self, part: slice, at: int, counted: int, length: int, account: Account, what: str) -> int:
        """Counts the headers of a part from `at` on, and the bytes between; the place up to which bytes are counted."""
        chosen = self.start[part] >= at
        start, end, fits = self.start[part][chosen], self.end[part][chosen], self.fits[part][chosen]
        if not len(start):
            return counted
        reach = np.maximum.accumulate(np.concatenate(([counted], np.minimum(end, length))))
        between = np.flatnonzero(start > reach[:-1])
        if len(between):
            first = int(between[0])
            missing = f"{int(start[first] - reach[first])} bytes"
            account.skip(f"bytes that belong to no {what}", int(reach[first]), missing, count=len(between))
        account.read += len(start)
        cut = end > length
        for reason, those in (("truncated", cut), ("bad checksum", ~cut & ~fits), (EMPTY, fits)):
            found = np.flatnonzero(those)
            if len(found):
                begin, size = int(start[found[0]]), int(end[found[0]] - start[found[0]])
                detail = f"{length - begin} of {size} bytes" if reason == "truncated" else f"{size} bytes"
                account.skip(reason, begin, detail, count=len(found))
        return int(reach[-1])
