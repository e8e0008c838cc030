"""MicroStrain MIP 0x13,0x2A: velocity in body axes with σ and validity of each axis.

An axis whose flag is off is ignored, so of a partial velocity everything is sent that lies along platform axes, and
nothing else. The diagonal of σ is the over-bound of the axes that are sent.

A packet is 0x75 0x65, the descriptor set, the length of its payload, the fields, and Fletcher's checksum of all that
comes before; numbers are big-endian. Source: MicroStrain's MIP SDK, commands_aiding.h, and the manuals' "MIP packet".
"""

import math
import struct
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from bottomlock.ports.estimate import Estimate
from bottomlock.ports.over_bound import diagonal_bound, single_at_least
from bottomlock.ports.port import Port
from bottomlock.units import ns_from_s

_SYNC, _AIDING, _VELOCITY = b"\x75\x65", 0x13, 0x2A
_TIMEBASE = {"internal": 1, "external": 2, "arrival": 3}
# timebase, reserved, nanoseconds, frame, velocity, uncertainty, flags
_FIELD = struct.Struct(">BBQB3f3fH")
# A component is in the row space of the beams if this much of its unit vector is.
_IN_ROW_SPACE = 1.0 - 1e-9


class MicroStrain(Port):
    """VelBodyFrame of the CV7 and GQ7."""

    name = "microstrain"

    frame_id: Annotated[int, Field(ge=1, le=255)] = 1
    """of the aiding frame that is configured in the receiver for our platform axes"""
    timebase: Literal["external", "arrival"] = "external"
    """external: our time since 1970 plus `time_offset_s`, for a receiver synchronised to that clock; arrival:
    `latency_s` before its arrival"""
    time_offset_s: Annotated[float, Field(ge=-1e9, le=1e9)] = 0.0
    """see `timebase`"""
    latency_s: Annotated[float, Field(gt=0, le=3600)] | None = None
    """see `timebase`; needed with arrival and only there"""
    unseen: Literal["omit", "estimate"] = "omit"
    """in mode navigation, omit axes that the beams of the last ping do not determine, or send the estimate of them
    too, with its own σ"""

    @model_validator(mode="after")
    def _latency_is_of_arrival(self) -> Self:
        if (self.timebase == "arrival") != (self.latency_s is not None):
            expected = "seconds with 'arrival' and nothing with 'external'"
            raise self.wrong("latency_s", expected, f" with timebase '{self.timebase}'")
        return self

    def _axes(self, estimate: Estimate) -> NDArray[np.bool_]:
        """(3,) the platform axes that are sent."""
        if estimate.mode == "velocity" or self.unseen == "estimate":
            return estimate.components
        axes, _, _ = estimate.observable_axes()
        return np.asarray((axes**2).sum(axis=0) > _IN_ROW_SPACE)

    def _refuses(self, estimate: Estimate) -> str | None:
        if self._axes(estimate).any():
            return None
        return f"the beams determine {estimate.rank} of 3 axes, and none along a platform axis"

    def _message(self, estimate: Estimate) -> bytes:
        there = self._axes(estimate)
        variances = np.zeros(3)
        variances[there] = diagonal_bound(estimate.covariance_m2ps2[np.ix_(there, there)])
        velocity = np.where(there, estimate.velocity_p_mps, 0.0).tolist()
        sd = [single_at_least(math.sqrt(variance)) for variance in variances.tolist()]
        time_ns = estimate.time_ns + ns_from_s(self.time_offset_s)
        if self.latency_s is not None:
            time_ns = ns_from_s(self.latency_s)
        flags = sum(1 << axis for axis, ok in enumerate(there) if ok)
        field = _FIELD.pack(_TIMEBASE[self.timebase], 1, time_ns, self.frame_id, *velocity, *sd, flags)
        length = len(field) + 2
        packet = _SYNC + bytes([_AIDING, length, length, _VELOCITY]) + field
        return packet + fletcher(packet)


def fletcher(packet: bytes) -> bytes:
    """Fletcher's checksum of two bytes.

    >>> fletcher(bytes.fromhex("7565010202 01")).hex()
    'e0c6'
    """
    first = second = 0
    for byte in packet:
        first = (first + byte) & 0xFF
        second = (second + first) & 0xFF
    return bytes([first, second])
