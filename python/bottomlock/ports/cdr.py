"""Little-endian CDR, as ROS 2 messages are serialised: a writer of the few types that our messages hold.

Each number is aligned to its size, counted from the end of the 4-byte header. Source: OMG, Common Data Representation
(plain CDR, XCDR1).
"""

import struct
from functools import partialmethod

_HEADER = b"\x00\x01\x00\x00"


class CdrWriter:
    """Appends values; `bytes(writer)` is the message."""

    def __init__(self) -> None:
        self._body = bytearray()

    def __bytes__(self) -> bytes:
        return _HEADER + bytes(self._body)

    def _put(self, code: str, *values: float) -> None:
        size = struct.calcsize("<" + code)
        for value in values:
            self._body += bytes(-len(self._body) % size) + struct.pack("<" + code, value)

    # Any count of numbers of a type; booleans are bytes.
    uint8, uint32, int32 = partialmethod(_put, "B"), partialmethod(_put, "I"), partialmethod(_put, "i")
    float32, float64 = partialmethod(_put, "f"), partialmethod(_put, "d")

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
