"""A byte stream cut into whole records, however the bytes come in pieces.

A framer is given bytes as they arrive and returns the records that have become whole: a text line, the lines of one
ping, or a binary record whose checksum fits. What comes out depends on the bytes alone, not on how they were cut
(`tests/io/test_framing.py`). The fields of a record are read by the readers of `bottomlock.io`.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass

from bottomlock.io.sentences import LONGEST_LINE, hexadecimal, xor_of

_WORD = struct.Struct("<H")
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

    Every place where a header may stand is followed up to the end that it states, so that neither a damaged record nor
    bytes that look like a header hide the next whole record. Of records that overlap, the one that ends first is taken.

    Args:
        sync: first bytes of a header.
        header: the size of a record from its first bytes; 0 where they are no header, None where more must come.
        fits: whether the bytes of a record fit its checksum.
    """

    def __init__(
        self, sync: bytes, header: Callable[[bytes], int | None], fits: Callable[[bytes], bool]
    ) -> None:
        super().__init__()
        self._sync, self._header, self._fits = sync, header, fits
        self._buffer = b""
        self._searched = 0  # places before it are known
        self._open: list[tuple[int, int]] = []  # end and start of each place where a record may stand

    def feed(self, data: bytes) -> list[bytes]:
        """The records that `data` completes."""
        self._buffer += data
        self._search()
        found = []
        behind = 0
        size = len(self._buffer)
        for end, start in sorted(place for place in self._open if place[0] <= size):
            if start < behind:
                continue
            record = self._buffer[start:end]
            if self._fits(record):
                self.dropped += start - behind
                found.append(record)
                behind = end
        self._open = [place for place in self._open if place[0] > size and place[1] >= behind]
        self._searched = max(self._searched, behind)
        self._trim(behind)
        return found

    def _search(self) -> None:
        """Notes every place from `_searched` on where a header stands."""
        at = self._buffer.find(self._sync, self._searched)
        while at >= 0:
            size = self._header(self._buffer[at : at + 1024])
            if size is None:
                self._searched = at
                return
            if size:
                self._open.append((at + size, at))
            at = self._buffer.find(self._sync, at + 1)
        self._searched = max(self._searched, len(self._buffer) - len(self._sync) + 1)

    def _trim(self, behind: int) -> None:
        """Drops the bytes that no record can begin in."""
        keep = min([self._searched, *(start for _, start in self._open)])
        self.dropped += max(keep - behind, 0)
        self._buffer = self._buffer[keep:]
        self._searched -= keep
        self._open = [(end - keep, start - keep) for end, start in self._open]

    def reset(self) -> None:
        """Drops a record that has begun."""
        self.dropped += len(self._buffer)
        self._buffer, self._searched, self._open = b"", 0, []


def _word(data: bytes, at: int) -> int:
    return int(_WORD.unpack_from(data, at)[0])


def _pd0_size(head: bytes) -> int | None:
    """Size of a PD0 ensemble from its header (sync, size, number of types, their offsets), with the checksum."""
    if len(head) < 8:
        return None
    size, types = _word(head, 2), head[5]
    first = 6 + 2 * types
    if not types or _word(head, 6) != first or first + 2 > size:
        return 0
    if len(head) < first + 2:
        return None
    return size + 2 if head[first] <= 1 and head[first + 1] == 0 else 0


def _pd0_fits(record: bytes) -> bool:
    return sum(record[:-2]) & 0xFFFF == _word(record, len(record) - 2)


def _nortek_sum(data: bytes) -> int:
    """Nortek's checksum: little-endian words from 0xB58C on, an odd last byte counted as a high one."""
    words: tuple[int, ...] = struct.unpack_from(f"<{len(data) // 2}H", data)
    total = 0xB58C + sum(words)
    return (total + (data[-1] << 8 if len(data) % 2 else 0)) & 0xFFFF


def _nortek_size(head: bytes) -> int | None:
    """Size of a Nortek record from its header, whose own checksum must fit."""
    if len(head) < 2 or len(head) < head[1]:
        return None if len(head) < 2 or 10 <= head[1] <= 64 else 0
    size = head[1]
    if not 10 <= size <= 64 or _nortek_sum(head[: size - 2]) != _word(head, size - 2):
        return 0
    return size + _word(head, 4)


def _nortek_fits(record: bytes) -> bool:
    return _nortek_sum(record[record[1] :]) == _word(record, 6)


def pd0() -> Framer:
    """Framer of Teledyne's PD0."""
    return Binary(b"\x7f\x7f", _pd0_size, _pd0_fits)


def nortek() -> Framer:
    """Framer of Nortek's binary records."""
    return Binary(b"\xa5", _nortek_size, _nortek_fits)
