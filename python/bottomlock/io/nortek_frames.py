"""The binary framing that Nortek's instruments share: A5, header with checksum, data with checksum.

Header: sync A5, its own size, id, family, size of the data (u16), checksum of the data, checksum of the header. A
checksum starts from 0xB58C and adds little-endian words; an odd last byte counts as the high one.
"""

import datetime as dt
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bottomlock.io.beam_table import Account

_HEADER = struct.Struct("<4BHH")
_WORD = struct.Struct("<H")
_LEAST, _MOST = 10, 64
_EPOCH = dt.date(1970, 1, 1).toordinal()
BOTTOM_AD2CP, BOTTOM_DVL, WATER_DVL = 0x17, 0x1B, 0x1D
BOTTOM_NUCLEUS, WATER_NUCLEUS = 0xB4, 0xBE
NAMES = {
    0x15: "burst profile",
    0x16: "average profile",
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


@dataclass(frozen=True)
class Frame:
    """A record whose checksums fit: where it begins, what it is, its data."""

    position: int
    kind: int
    family: int
    data: bytes


class _Sums:
    """Checksums of any piece of the bytes in constant time, from running sums of even and odd bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        raw = np.frombuffer(data, dtype=np.uint8)
        # Two alignments: words that begin at an even and at an odd place. Sums modulo 65536, as the checksum is.
        self._sums = [np.zeros(len(data) + 1, dtype=np.uint16) for _ in range(2)]
        for low, sums in enumerate(self._sums):
            weighted = raw.astype(np.uint16)
            weighted[1 - low :: 2] <<= 8
            np.cumsum(weighted, dtype=np.uint16, out=sums[1:])

    def of(self, start: int, size: int) -> int:
        """Nortek's checksum of `size` bytes from `start`."""
        sums = self._sums[start % 2]
        total = 0xB58C + int(sums[start + size]) - int(sums[start])
        if size % 2:
            # The last byte was added as a low one.
            total += 255 * self._data[start + size - 1]
        return total & 0xFFFF


def frames(data: bytes, account: Account) -> Iterator[Frame]:
    """Every record of the bytes; what is damaged, cut off or between records goes to the account."""
    sums = _Sums(data) if data else None
    at = counted = 0
    while sums is not None and (at := data.find(b"\xa5", at)) >= 0:
        if at + _LEAST > len(data):
            break
        _, header, kind, family, size, given = _HEADER.unpack_from(data, at)
        if not _LEAST <= header <= _MOST or at + header > len(data):
            at += 1
            continue
        if sums.of(at, header - 2) != _WORD.unpack_from(data, at + header - 2)[0]:
            at += 1
            continue
        if at > counted:
            account.skip("bytes that belong to no record", counted, f"{at - counted} bytes")
        account.read += 1
        start = at + header
        if start + size > len(data):
            account.skip("truncated", at, f"{len(data) - at} of {header + size} bytes")
        elif sums.of(start, size) != given:
            account.skip("bad checksum", at, f"{header + size} bytes")
        else:
            yield Frame(at, kind, family, data[start : start + size])
            at = counted = start + size
            continue
        # The header was good, its data were not: the next record may begin within them.
        counted = max(counted, min(start + size, len(data)))
        at = start
    if counted < len(data):
        account.skip("bytes that belong to no record", counted, f"{len(data) - counted} bytes")


def kinds(head: bytes) -> set[int]:
    """Ids of the whole records at the beginning of a file."""
    return {frame.kind for frame in frames(head, Account(unit="byte"))}


def name_of(kind: int) -> str:
    """Description of a record of this id."""
    return NAMES.get(kind, f"record 0x{kind:02x}")


def struct_tm_ns(fields: bytes, hundred_us: int) -> int | None:
    """Year since 1900, month from 0, day, hour, minute, second as bytes, and 100 µs, as ns since 1970."""
    year, month, day, hour, minute, second = fields
    if hour > 23 or minute > 59 or second > 60 or hundred_us > 9999:
        return None
    try:
        days = dt.date(1900 + year, month + 1, day).toordinal() - _EPOCH
    except ValueError:
        return None
    return (days * 86_400 + hour * 3600 + minute * 60 + second) * 1_000_000_000 + hundred_us * 100_000
