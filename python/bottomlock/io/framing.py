"""A byte stream cut into whole records, however the bytes come in pieces.

A framer is given bytes as they arrive and returns the records that have become whole: a text line, or a binary record
whose checksum fits (`binary_records`). What comes out depends on the bytes alone, not on how they were cut. The fields
of a record are read by the decoders of `bottomlock.io`.
"""

from collections.abc import Iterator

from bottomlock.io.sentences import LONGEST_LINE

_BLANKS = b"\r\n \t\x00"


class Framer:
    """Cuts a stream into records; by itself, messages, which their transport keeps apart, so that each is one.

    Attributes:
        dropped: bytes that belonged to no record.
    """

    def __init__(self) -> None:
        self.dropped = 0

    def feed(self, data: bytes) -> list[bytes]:
        """The records that `data` completes."""
        return [data]

    def reset(self) -> None:
        """Forgets a record that has begun: the connection was made anew."""


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
        self._number = 0

    def feed(self, data: bytes) -> list[bytes]:
        """The lines that `data` completes, without blanks and NULs around them."""
        return [line for _, line in self.numbered(data) if len(line) <= self._longest]

    def numbered(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """The same with their numbers, from 1; of one that is too long a byte more than the longest."""
        *ends, rest = data.split(b"\n")
        for end in ends:
            self._take(end)
            line, self._dropping = bytes(self._part), False
            self._part.clear()
            self._number += 1
            if len(line) > self._longest:
                self.dropped += len(line)
                yield self._number, line
            elif solid := line.strip(_BLANKS):
                yield self._number, solid
        self._take(rest)

    def _take(self, piece: bytes) -> None:
        """Adds to the line that has begun; of one that is too long no more than shows it."""
        room = 0 if self._dropping else self._longest + 1 - len(self._part)
        solid = piece if self._part or self._dropping else piece.lstrip(_BLANKS)
        self._part += solid[:room]
        self.dropped += max(len(solid) - room, 0)

    def reset(self) -> None:
        """Drops a line that has begun."""
        self.dropped += len(self._part)
        self._part.clear()
        self._dropping = self._within
