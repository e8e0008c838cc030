"""Nortek Nucleus1000: the bottom-track record of three beams (id 0xB4) and, with water, that of water track (0xBE).

Numbers are 32-bit floats; status bits say which velocities, distances and figures of merit are valid. The clock is that
of the trigger, in s and µs since 1970; `dt` leads from there to the centre of the echo.

Source: the manufacturer's driver.
"""

import struct

from bottomlock.encoders.fields import NO_FOM_MPS, steps_of
from bottomlock.encoders.framing import nortek_frame
from bottomlock.encoders.nortek_dvl import axes_and_fom, beam_range, beam_velocity, bottom_and_water, echo_s
from bottomlock.encoders.ping import Ping

_FAMILY = 0x20
_POSIX = 1
_SERIAL = 4711
_LATEST_US = 2**32 * 1_000_000 - 1


def _record(kind: int, ping: Ping) -> bytes:
    """A record of the layout that bottom and water share."""
    seconds, micros = divmod(steps_of(ping.sent_ns, 1000, 0, _LATEST_US, ping), 1_000_000)
    beams = range(3)
    axes, axes_fom, known = axes_and_fom(ping)
    ranges, echoes = [beam_range(ping, k) for k in beams], [echo_s(ping, k) for k in beams]
    status = 0b111111 << 9 if known else 0
    for k in beams:
        status |= int(ping.valid[k]) << k | int(ping.valid[k]) << 6 + k | int(ranges[k] > 0.0) << 3 + k
    numbers = [
        *(beam_velocity(ping, k) for k in beams),
        *ranges,
        *(ping.beam_sd_mps if good else NO_FOM_MPS for good in ping.valid),
        *echoes,
        *[0.0] * 3,
        *axes,
        *axes_fom,
        sum(echoes) / 3,
        0.0,
    ]
    head = struct.pack(
        "<4B3I2I3f", 2, 36, _POSIX, 0, seconds, micros, status, _SERIAL, 0, ping.sound_speed_mps, 12.0, 1.0
    )
    return nortek_frame(kind, head + struct.pack("<23f", *numbers), _FAMILY)


encode = bottom_and_water(_record, 0xB4, 0xBE)
