"""Little-endian CDR, as ROS 2 messages are serialised: a writer of the few types that our messages hold.

Each number is aligned to its size, counted from the end of the 4-byte header. Source: OMG, Common Data Representation
(plain CDR, XCDR1).
"""

import struct
from collections.abc import Iterable

_HEADER = b"\x00\x01\x00\x00"


class CdrWriter:
    """Appends values; `bytes(writer)` is the message."""

    def __init__(self) -> None:
        self._body = bytearray()

    def __bytes__(self) -> bytes:
        return _HEADER + bytes(self._body)

    def _put(self, code: str, values: Iterable[float]) -> None:
        size = struct.calcsize("<" + code)
        for value in values:
            self._body += bytes(-len(self._body) % size) + struct.pack("<" + code, value)

    def uint8(self, *values: int) -> None:
        """Bytes, also booleans."""
        self._put("B", values)

    def uint32(self, *values: int) -> None:
        """32-bit numbers."""
        self._put("I", values)

    def int32(self, *values: int) -> None:
        """32-bit numbers with a sign."""
        self._put("i", values)

    def float32(self, *values: float) -> None:
        """Single precision."""
        self._put("f", values)

    def float64(self, *values: float) -> None:
        """Double precision."""
        self._put("d", values)

    def string(self, text: str) -> None:
        """A string with its length and a closing zero."""
        data = text.encode() + b"\x00"
        self.uint32(len(data))
        self._body += data

    def header(self, time_ns: int, frame_id: str) -> None:
        """`std_msgs/Header`."""
        seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
        self.int32(seconds)
        self.uint32(nanoseconds)
        self.string(frame_id)
