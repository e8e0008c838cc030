"""Text records: lines, sentences, numbers, checksums, and how they are shown."""

import functools
import operator
import re

LONGEST_LINE = 4096
"""Longest line that is searched for a sentence; no instrument's sentence is longer."""


def show(line: bytes) -> str:
    """The beginning of a line as it may stand in a report."""
    return printable(line[:60].decode("ascii", "backslashreplace"))


def printable(text: str) -> str:
    r"""Text from a file without characters that would break a line or a terminal.

    >>> printable("a\nb")
    'a\\x0ab'
    """
    return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)


def without_numbers(text: str) -> str:
    """An error without what differs from case to case, so that equal ones are counted together."""
    return re.sub(r"[0-9]+", "…", text)


def number(text: bytes) -> float | None:
    """A decimal number, or None for anything else (also for the words that Python would take for one).

    >>> number(b" -0.5"), number(b"nan"), number(b"1_0"), number(b"")
    (-0.5, None, None, None)
    """
    if b"n" in text or b"N" in text or b"_" in text:
        return None
    try:
        return float(text)
    except ValueError:
        return None


def whole(text: bytes) -> int | None:
    """A whole number of at most 20 characters, or None.

    >>> whole(b" -7 "), whole(b"+-7"), whole(b"7.0"), whole(b"1_0")
    (-7, None, None, None)
    """
    text = text.strip()
    digits = text[1:] if text[:1] in {b"+", b"-"} else text
    return int(text) if len(text) <= 20 and digits.isdigit() else None


def xor_of(text: bytes) -> int:
    """NMEA 0183: the exclusive or of the bytes between `$` and `*`.

    >>> hex(xor_of(b"PNORBT0,1,040721,131335.3341,23.961,-48.122,-32.76800,10.00000,0.00,0x00000000"))
    '0x48'
    """
    return functools.reduce(operator.xor, text, 0)


@functools.cache
def _crc8_table(polynomial: int) -> bytes:
    """What a byte becomes after eight further bits."""
    table = list(range(256))
    for _ in range(8):
        table = [value << 1 ^ polynomial if value & 0x80 else value << 1 for value in table]
    return bytes(table)


def crc8_of(text: bytes, polynomial: int) -> int:
    """CRC-8 that starts from 0, not reflected.

    >>> hex(crc8_of(b"wru,0,0.070,1.10,-40,-95", 0x107))
    '0x9c'
    """
    table, value = _crc8_table(polynomial), 0
    for byte in text:
        value = table[value ^ byte]
    return value


def hexadecimal(text: bytes) -> int | None:
    """Hexadecimal digits to a number, or None; without sign, blanks or underscores.

    >>> hexadecimal(b"9c"), hexadecimal(b"+1"), hexadecimal(b"")
    (156, None, None)
    """
    if not text or len(text) > 16 or not text.isalnum():
        return None
    try:
        return int(text, 16)
    except ValueError:
        return None
