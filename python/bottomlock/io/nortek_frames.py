"""The binary framing that Nortek's instruments share: A5, header with checksum, data with checksum.

Header: sync A5, its own size, id, family, size of the data (u16), checksum of the data, checksum of the header. A
checksum starts from 0xB58C and adds little-endian words; an odd last byte counts as the high one.
"""

import numpy as np

from bottomlock.io.binary_records import Fits, Framing, calendar_ns, word_at

_LEAST, _MOST = 10, 64
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


def _sum(data: bytes) -> int:
    """The checksum of some bytes."""
    words = int(np.frombuffer(data, "<u2", len(data) // 2).sum(dtype=np.int64))
    return (0xB58C + words + (data[-1] << 8 if len(data) % 2 else 0)) & 0xFFFF


def _size(data: bytes, at: int) -> int | None:
    """Of the record whose header, with a checksum that fits, stands at a place."""
    if at + 1 >= len(data):
        return None
    size = data[at + 1]
    if not _LEAST <= size <= _MOST:
        return 0
    if at + size > len(data):
        return None
    fits = _sum(data[at : at + size - 2]) == word_at(data, at + size - 2)
    return size + word_at(data, at + 4) if fits else 0


def _fits(data: bytes) -> Fits:
    """Of the data of records."""

    def fits(start: int, end: int) -> bool:
        return _sum(data[start + data[start + 1] : end]) == word_at(data, start + 6)

    return fits


FRAMING = Framing(b"\xa5", "record", _size, _fits)
"""How a stream or a file is cut; id and family of a record are its third and fourth byte."""


def body(record: bytes) -> bytes:
    """The data of a record."""
    return record[record[1] :]


def kinds(head: bytes) -> set[int]:
    """Ids of the whole records at the beginning of a file."""
    return {record[2] for record in FRAMING.of(head)}


def name_of(kind: int) -> str:
    """Description of a record of this id."""
    return NAMES.get(kind, f"record 0x{kind:02x}")


def struct_tm_ns(fields: bytes, hundred_us: int) -> int | None:
    """Time since 1970, ns; None for one that no clock can show.

    Args:
        fields: year since 1900, month from 0, day, hour, minute, second.
        hundred_us: 100 µs.
    """
    year, month, *rest = fields
    return calendar_ns([year + 1900, month + 1, *rest], hundred_us * 100_000)
