"""The binary framing that Nortek's instruments share: A5, header with checksum, data with checksum.

Header: sync A5, its own size, id, family, size of the data (u16), checksum of the data, checksum of the header. A
checksum starts from 0xB58C and adds little-endian words; an odd last byte counts as the high one.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock.io.beam_table import Account, Flags, Integers
from bottomlock.io.binary_records import (
    Found,
    Headers,
    Places,
    Records,
    bytes_of,
    calendar_ns,
    every,
    search,
    words_at,
)  # fmt: skip

_MARK, _LEAST, _MOST = b"\xa5", 10, 64
BURST_AD2CP, AVERAGE_AD2CP, BOTTOM_AD2CP = 0x15, 0x16, 0x17
BOTTOM_DVL, WATER_DVL = 0x1B, 0x1D
BOTTOM_NUCLEUS, WATER_NUCLEUS = 0xB4, 0xBE
NAMES = {
    BURST_AD2CP: "burst profile",
    AVERAGE_AD2CP: "average profile",
    BOTTOM_AD2CP: "bottom track",
    0x18: "interleaved burst",
    0x1A: "altimeter",
    BOTTOM_DVL: "bottom track",
    0x1C: "echo sounder",
    WATER_DVL: "water track",
    0x82: "IMU",
    0x87: "magnetometer",
    0x8B: "field calibration",
    0xA0: "text",
    0xAA: "altimeter",
    BOTTOM_NUCLEUS: "bottom track",
    WATER_NUCLEUS: "water track",
    0xC0: "current profile",
    0xD2: "AHRS",
    0xDC: "INS",
}


@dataclass(frozen=True, eq=False)
class Frames:
    """Records whose checksums fit, each (n,): where they begin, what they are, where their data begin, their size."""

    position: Places
    kind: NDArray[np.uint8]
    family: NDArray[np.uint8]
    start: Places
    size: Places

    def where(self, chosen: Flags) -> "Frames":
        """The chosen ones."""
        if np.count_nonzero(chosen) == len(chosen):
            return self
        return Frames(*(each[chosen] for each in vars(self).values()))

    def pings(self, chosen: Flags, account: Account) -> "Frames":
        """The chosen ones; all others are counted by their names."""
        if (found := self.where(chosen)) is not self:
            others = self.where(~chosen)
            for kind in np.bincount(others.kind).nonzero()[0].tolist():
                account.pass_by_where(name_of(kind), others.kind == kind, others.position)
        return found

    def of_layout(self, layout: np.dtype[Any], account: Account) -> "Frames":
        """Those whose data are long enough for a layout; of the others it is told."""
        long = self.size >= layout.itemsize
        account.skip_where(
            "bottom track of another layout", ~long, self.position, lambda k: f"{self.size[k]} bytes"
        )
        return self.where(long)


_BEGIN = np.uint16(0xB58C)


class _Sums:
    """Checksums of any piece of the bytes in constant time, from running sums of words."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        # Before each place the words two, four ... bytes before it, modulo 65536, as the checksum is.
        self._sums = np.zeros(max(len(data) + 1, 2), dtype=np.uint16)
        self._sums[2:] = every(data)
        for words in (self._sums[::2], self._sums[1::2]):
            np.add.accumulate(words, out=words)

    def fit(self, start: Places, size: Places, stated: Places) -> Flags:
        """(n,) whether pieces are whole, and have the checksum that stands at `stated`."""
        whole: Flags = np.maximum(start + size, stated + 2) <= len(self._data)
        start, size = start[whole], size[whole]
        odd, sums = size & 1, self._sums
        # The last byte of an odd number is a high one.
        last = bytes_of(self._data).take(start + size - 1) * (odd << 8).astype(np.uint16)
        found = sums.take(start + size - odd) - sums.take(start) + last + _BEGIN
        whole[whole] = found == words_at(self._data, stated[whole])
        return whole


def _headers(data: bytes) -> Headers:
    """The headers of a file whose own checksum fits, with that of their data tested."""
    raw, sums = bytes_of(data), _Sums(data)

    def sound(at: Places) -> Flags:
        size = raw.take(at + 1).astype(np.int64) - 2
        return sums.fit(at, size, at + size)

    start = search(data, _MARK, _LEAST, {1: (_LEAST, _MOST)}, sound)
    begin, size = start + raw[start + 1], words_at(data, start + 4)
    end = begin + size
    fits = sums.fit(begin, size, start + 6)
    return Headers(start, end, fits, end < start)


RECORDS = Records(_MARK, _headers, _MOST, "record")
"""How a stream or a file is cut."""


def frames(found: Found) -> Frames:
    """The whole records."""
    raw, at = bytes_of(found.data), found.start
    start = at + raw[at + 1]
    return Frames(at, raw[at + 2], raw[at + 3], start, found.end - start)


def flags_of(status: NDArray[np.uint32], count: int) -> Flags:
    """(n, count) the least bits of status words, which say what is valid."""
    return np.asarray((status[:, None] >> np.arange(count) & 1).astype(bool))


def kinds(head: bytes) -> set[int]:
    """Ids of the whole records at the beginning of a file."""
    return set(frames(RECORDS.of(head)).kind.tolist())


def name_of(kind: int) -> str:
    """Description of a record of this id."""
    return NAMES.get(kind, f"record 0x{kind:02x}")


def struct_tm_ns(fields: NDArray[np.uint8], hundred_us: Integers) -> tuple[Integers, Flags]:
    """Times since 1970, ns, and which of them a clock can show.

    Args:
        fields: (n, 6) year since 1900, month from 0, day, hour, minute, second.
        hundred_us: (n,) 100 µs.
    """
    return calendar_ns(fields + _TM, hundred_us.astype(np.int64) * 100_000)


_TM = np.array([1900, 1, 0, 0, 0, 0])
