"""Records without beam velocities, PD6 (text), PD3, PD4 and PD5 (binary): refused, with what to record instead."""

import re
from typing import NoReturn

from bottomlock.errors import DataError
from bottomlock.io.rows import PLAIN, Options

NAME = "pd6"
NAME_BINARY = "pd4"
_START = re.compile(rb":(SA|TS|BI|BS|BE|BD|WI|WS|WE|WD),")
_VELOCITY = re.compile(rb":BI" + rb",\s{0,8}[+-]\s{0,8}[0-9]{1,6}" * 4 + rb",[AV]")
_PD3_BYTES = 55
_STATED_BYTES = (45, 86)
"""Lengths that PD4 and PD5 state of themselves."""
ADVICE = (
    "set the instrument to PD0 in beam coordinates (PD0, EX00000) and record again; a Water Linked instrument to its "
    "own protocol, on serial (wrz, wru) or TCP port 16171"
)


def sniff(head: bytes) -> bool:
    """Whether the beginning of a file looks like PD6."""
    return len(set(_START.findall(head))) >= 3 or _VELOCITY.search(head) is not None


def sniff_binary(head: bytes) -> bool:
    """Whether a file begins with a whole record of PD3, PD4 or PD5, whose sum of bytes follows it."""
    if head[:1] not in {b"\x7d", b"\x7e"}:
        return False
    size = _PD3_BYTES if head[:1] == b"\x7e" else int.from_bytes(head[2:4], "little")
    known = size in {_PD3_BYTES, *_STATED_BYTES} and len(head) >= size + 2
    return known and sum(head[:size]) & 0xFFFF == int.from_bytes(head[size : size + 2], "little")


def read(data: bytes, place: str, options: Options = PLAIN) -> NoReturn:  # noqa: ARG001 - as every reader
    """Refuses PD6.

    Raises:
        DataError: always.
    """
    raise DataError("PD6 holds no beam velocities", place=place, hint=ADVICE)


def read_binary(data: bytes, place: str, options: Options = PLAIN) -> NoReturn:  # noqa: ARG001 - as every reader
    """Refuses PD3, PD4 and PD5.

    Raises:
        DataError: always.
    """
    raise DataError("PD3, PD4 and PD5 hold no beam velocities", place=place, hint=ADVICE)
