"""A byte stream cut into whole records, however the bytes come in pieces.

A framer is given bytes as they arrive and returns the records that have become whole: a text line, the lines of one
ping, or a binary record whose checksum fits. What comes out depends on the bytes alone, not on how they were cut
(`tests/io/test_framing.py`). The fields of a record are read by the readers of `bottomlock.io`.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bottomlock.io.binary_records import Headers
from bottomlock.io.sentences import LONGEST_LINE, hexadecimal, xor_of

_PNORBT = re.compile(
    rb"\$(PNORBT[01],(?:BEAM=)?([0-9]{1,2}),([^,*$]{0,24},[^,*$]{0,24}),[^*$]{0,400})\*([0-9A-Fa-f]{2})"
)


_WRS = re.compile(rb"wrs(?:,[^,*\n]{0,200}){10}\*")
"""A velocity through the water; another number of fields is that of another sentence."""


class Framer:
    """Cuts a stream into records; by itself, messages, which their transport keeps apart, so that each is one.

    Attributes:
        dropped: bytes that belonged to no record.
    """

    def __init__(self) -> None:
        self.dropped = 0

    @property
    def waiting(self) -> bool:
        """Whether lines of a ping are held of which more may come."""
        return False

    def feed(self, data: bytes) -> list[bytes]:
        """The records that `data` completes."""
        return [data]

    def flush(self) -> list[bytes]:
        """The lines of an incomplete ping as a record, where nothing more has come for a while."""
        return []

    def reset(self) -> None:
        """Forgets a record that has begun: the connection was made anew."""


@dataclass(frozen=True)
class Stream:
    """How a format comes as a stream of bytes.

    Attributes:
        frame: its framer, for a number of beams.
        kind: the third byte of the records with beams; None where all have them.
        water: those of records of the water alone.
        transmission: where a report says when it was sent, µs; None where it does not.
        repeats: whether a report may repeat the beams of the report before.
        sums: whether older versions carry intervals in place of times.
        lost: whether a record without any beam is a ping, with all of them lost.
        figures: whether its records can hold a figure of merit of each beam, 1 sigma.
    """

    frame: Callable[[int], Framer]
    kind: int | None = None
    water: tuple[int, ...] = ()
    transmission: re.Pattern[bytes] | None = None
    repeats: bool = False
    sums: bool = False
    lost: bool = False
    figures: bool = False


class Lines(Framer):
    """Text lines without their ends; a line that is longer than `longest` is dropped.

    With `within` the stream may begin in the middle of a line, as that of a serial device does: what comes before the
    first end of a line is dropped, at the start and after a reset.
    """

    def __init__(self, longest: int = LONGEST_LINE, *, within: bool = False) -> None:
        super().__init__()
        self._longest, self._within = longest, within
        self._part = bytearray()
        self._dropping = within

    def feed(self, data: bytes) -> list[bytes]:
        """The lines that `data` completes, without blanks and NULs around them."""
        found = []
        *ends, rest = data.split(b"\n")
        for end in ends:
            line = self._take(end)
            self._part.clear()
            self._dropping = False
            if line:
                found.append(line)
        self._take(rest)
        return found

    def _take(self, piece: bytes) -> bytes:
        """Adds a piece to the line that has begun, which is dropped once it is too long."""
        if self._dropping:
            self.dropped += len(piece)
            return b""
        self._part += piece
        if len(self._part) > self._longest:
            self.dropped += len(self._part)
            self._part.clear()
            self._dropping = True
        return bytes(self._part).strip(b"\r\n \t\x00")

    def reset(self) -> None:
        """Drops a line that has begun."""
        self.dropped += len(self._part)
        self._part.clear()
        self._dropping = self._within


class _Groups(Lines):
    """Base of framers that gather the lines of one ping."""

    def __init__(self, beams: int) -> None:
        super().__init__()
        self._beams = beams
        self._held: list[bytes] = []

    @property
    def waiting(self) -> bool:
        """Whether lines are held of which more may come."""
        return bool(self._held)

    def feed(self, data: bytes) -> list[bytes]:
        """The groups of lines that `data` completes."""
        found: list[bytes] = []
        for line in super().feed(data):
            self._add(line, found)
        return found

    def _add(self, line: bytes, found: list[bytes]) -> None:
        raise NotImplementedError

    def _emit(self, found: list[bytes]) -> None:
        if self._held:
            found.append(b"\n".join(self._held) + b"\n")
            self._held = []

    def flush(self) -> list[bytes]:
        """The lines that are held, as a record."""
        found: list[bytes] = []
        self._emit(found)
        return found

    def reset(self) -> None:
        """Drops lines that are held and a line that has begun."""
        self.dropped += sum(map(len, self._held))
        self._held = []
        super().reset()


class WaterLinkedLines(_Groups):
    """A velocity report, `wrz` or `wrs`, with its transducers `wru`.

    It is complete with the fourth, or where the next report begins.
    """

    def _add(self, line: bytes, found: list[bytes]) -> None:
        if b"wrz" in line or b"wrx" in line or _WRS.search(line):
            self._emit(found)
            self._held = [line]
            if b"wrx" in line:
                self._emit(found)
                return
        elif self._held:
            self._held.append(line)
        else:
            self.dropped += len(line)
            return
        if sum(held.count(b"wru,") for held in self._held) >= self._beams:
            self._emit(found)


class NortekLines(_Groups):
    """The lines `$PNORBT` of one time, a line a beam: complete with the last beam, or where another time begins."""

    def __init__(self, beams: int) -> None:
        super().__init__(beams)
        self._time = b""
        self._numbers: set[bytes] = set()

    def _add(self, line: bytes, found: list[bytes]) -> None:
        for match in _PNORBT.finditer(line):
            text, number, time, digits = match.groups()
            if xor_of(text) != hexadecimal(digits):
                self.dropped += len(match.group())
                continue
            if self._held and (time != self._time or number in self._numbers):
                self._emit(found)
            if not self._held:
                self._numbers = set()
            self._time = time
            self._numbers.add(number)
            self._held.append(match.group())
            if len(self._numbers) == self._beams:
                self._emit(found)


class Binary(Framer):
    """Records with a header that states their size, and a checksum.

    Every place where a header stands is followed up to the end that it states, so that neither a damaged record nor
    bytes that look like a header hide the next whole record. Of records that overlap, the one that ends first is taken.

    Args:
        headers: finds the headers in bytes, as the reader of files does.
        longest: bytes of the longest header.
    """

    def __init__(self, headers: Callable[[bytes], Headers], longest: int) -> None:
        super().__init__()
        self._headers, self._longest = headers, longest
        self._buffer = b""

    def feed(self, data: bytes) -> list[bytes]:
        """The records that `data` completes."""
        self._buffer += data
        size, headers = len(self._buffer), self._headers(self._buffer)
        found, behind = [], 0
        for k in np.lexsort((headers.start, headers.end)):
            start, end = int(headers.start[k]), int(headers.end[k])
            if headers.fits[k] and start >= behind:
                self.dropped += start - behind
                found.append(self._buffer[start:end])
                behind = end
        begun = headers.start[(headers.end > size) & (headers.start >= behind)]
        keep = max(behind, min([size - self._longest, *begun.tolist()]))
        self.dropped += keep - behind
        self._buffer = self._buffer[keep:]
        return found

    def reset(self) -> None:
        """Drops a record that has begun."""
        self.dropped += len(self._buffer)
        self._buffer = b""
