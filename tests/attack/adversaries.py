"""Inputs of about a megabyte that cost a careless reader hours: false starts, overlapping lengths, endless lines."""

import struct

from bottomlock.encoders import framing
from tools import reader_seeds as seeds


def _pd0_headers(size: int) -> bytes:
    """Sound headers without an ensemble behind them, one after the other, each of which states `size` bytes."""
    return struct.pack("<BBHBBHH", 0x7F, 0x7F, size, 0, 1, 8, 0) * 100_000


def _tiny_ensembles() -> bytes:
    """Whole ensembles with a good checksum, and nothing in them."""
    return framing.pd0_wrap([b"\x00\x00"]) * 80_000


def _nortek_headers(size: int) -> bytes:
    """Records whose headers are good, and whose data of `size` bytes are other records' headers: the sum is wrong."""
    head = struct.pack("<4BHH", 0xA5, 10, 0x1B, 0x16, size, 1)
    return (head + struct.pack("<H", framing.nortek_sum(head))) * 100_000


ADVERSARIES: dict[str, list[bytes]] = {
    "pd0": [
        b"\x7f\x7f" * 500_000,
        _pd0_headers(10),
        _pd0_headers(3000),
        _tiny_ensembles(),
        (b"\x7f\x7f\xff\xff\x00\x01\x08\x00\x00\x00" * 100_000),
    ],
    "nortek-dvl": [
        b"\xa5" * 1_000_000,
        _nortek_headers(0),
        _nortek_headers(10),
        _nortek_headers(3000),
        framing.nortek_frame(0x1B, b"")[:8].ljust(10, b"\0") * 100_000,
    ],
    "nortek-ad2cp": [b"\xa5\x0a" * 500_000],
    "nucleus": [b"\xa5\x0a\xb4\x20" * 250_000],
    "waterlinked-json": [
        b"[" * 60_000,
        b'{"time":' * 8_000,
        b'{"time":1,"transducers":[' * 40_000,
        b"{" * 1_000_000,
    ],
    "waterlinked-serial": [b"wrz," * 250_000, b"wrz,1\n" * 150_000, (b"wr" * 2_000 + b"\n") * 200],
    "nortek-ascii": [b"$PNOR," * 160_000, (b"$PNOR," * 600 + b"\n") * 250],
    "cerulean-dvkfc": [b"$DVKFC," * 140_000, (b"$DVKF" * 800 + b"\n") * 250],
    "cerulean-dvext": [b"$DVEXT," * 140_000, (b"$DVEX" * 800 + b"\n") * 250],
    "nucleus-csv": [seeds.nucleus_csv([]) + b"," * 1_000_000, seeds.nucleus_csv([]) + b"1,\n" * 300_000],
    "wayfinder": [
        b"\xaa\x10\x01" * 330_000,
        b"\xaa\x10\x01\x00\x10" * 200_000,
        b"\xaa\x10\x01\x07\x00" * 200_000,
    ],
    "linkquest-csv": [seeds.linkquest_log() + b"," * 1_000_000, seeds.linkquest_log() + b"1,\n" * 300_000],
}
"""By name of format."""
