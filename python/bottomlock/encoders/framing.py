"""Checksums and framing of the records, as their makers define them.

They share no code with the readers, so that a record read back tests both.
"""

import struct
from collections.abc import Sequence


def crc8(text: bytes, polynomial: int = 0x07) -> int:
    """CRC-8, start 0, not reflected: Water Linked with 0x07, Cerulean's example with 0x31.

    >>> hex(crc8(b"wru,0,0.070,1.10,-40,-95"))
    '0x9c'
    """
    value = 0
    for byte in text:
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ polynomial) & 0xFF if value & 0x80 else value << 1
    return value


def nortek_sum(data: bytes) -> int:
    """Nortek's: little-endian words from 0xB58C on; an odd last byte counts as the high one."""
    total = 0xB58C
    for k in range(0, len(data) - 1, 2):
        total += data[k] | data[k + 1] << 8
    if len(data) % 2:
        total += data[-1] << 8
    return total & 0xFFFF


def nortek_frame(kind: int, data: bytes, family: int = 0x16) -> bytes:
    """A Nortek record: header with its own checksum and that of the data, then the data."""
    head = struct.pack("<4BHH", 0xA5, 10, kind, family, len(data), nortek_sum(data))
    return head + struct.pack("<H", nortek_sum(head)) + data


def pd0_wrap(types: Sequence[bytes]) -> bytes:
    """Teledyne data types with header, offsets and the 16-bit sum of all bytes."""
    at, offsets = 6 + 2 * len(types), []
    for one in types:
        offsets.append(at)
        at += len(one)
    head = struct.pack("<BBHBB", 0x7F, 0x7F, at, 0, len(types)) + struct.pack(f"<{len(types)}H", *offsets)
    body = head + b"".join(types)
    return body + struct.pack("<H", sum(body) & 0xFFFF)


def waterlinked_sentence(text: bytes) -> bytes:
    """A Water Linked serial sentence with its checksum and line end."""
    return text + b"*%02x\r\n" % crc8(text)


def cerulean_sentence(text: bytes) -> bytes:
    """A `$` sentence with the checksum that Cerulean's published example has."""
    return b"$" + text + b"*%02X\r\n" % crc8(text, 0x31)
