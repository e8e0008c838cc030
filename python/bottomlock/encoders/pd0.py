"""Teledyne PD0: an ensemble with its leaders, bottom track (0x0600) and, with water, a profile of one cell (0x0100).

Ranges in cm with a third byte beyond 655.35 m, 0 for none; velocities in mm/s, -32768 for none; positive when the
bottom comes nearer, our b . v. The clock is the ensemble's, when the ping was sent, to a hundredth of a second, with
its century. Beam coordinates leave no room for the instrument's own velocity.

Source: Teledyne RD Instruments, Workhorse and Pathfinder guides, "PD0 output data format".
"""

import math
import struct

from bottomlock.encoders.fields import calendar, steps_of, whole
from bottomlock.encoders.framing import pd0_wrap
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.io.columns import LATEST_NS

BAD = -32768
_CORRELATION, _LOST_CORRELATION = 200, 20
_CONFIGURED_DEG = {15: 0, 20: 1, 30: 2}
_OTHER_ANGLE = 3
_CELL_CM = 200


def _fixed(ping: Ping, instrument: Instrument) -> bytes:
    """The fixed leader: 600 kHz, convex, looking down, four beams, beam coordinates, perhaps a cell of the water."""
    leader = bytearray(59)
    degrees = round(math.degrees(instrument.tilt_rad))
    angle = _CONFIGURED_DEG.get(degrees, _OTHER_ANGLE)
    struct.pack_into("<HBBH", leader, 0, 0x0000, 50, 1, 0x4000 | angle << 8 | 0x0B)
    leader[8], leader[25], leader[58] = 4, 0, degrees
    if ping.water_velocity_mps is not None:
        vertical_m = ping.water_range_m * math.cos(math.radians(degrees))
        middle = whole(vertical_m, 0.01, 0, 0xFFFF, ping, "distance of the water, m")
        leader[9] = 1
        struct.pack_into("<H", leader, 12, _CELL_CM)
        struct.pack_into("<H", leader, 32, middle)
    return bytes(leader)


def _variable(ping: Ping) -> bytes:
    """The variable leader: number, clock, sound speed, heading, pitch, roll."""
    leader = bytearray(65)
    when, hundredth = calendar(steps_of(ping.sent_ns, 10_000_000, 0, LATEST_NS // 10_000_000, ping), 100)
    clock = bytes([when.year % 100, when.month, when.day, when.hour, when.minute, when.second, hundredth])
    struct.pack_into("<HH", leader, 0, 0x0080, ping.number & 0xFFFF)
    leader[4:11] = clock
    leader[11] = ping.number >> 16 & 0xFF
    roll, pitch, yaw = (0.0, 0.0, 0.0) if ping.attitude_rad is None else map(math.degrees, ping.attitude_rad)
    angles = [
        whole(yaw % 360.0, 0.01, 0, 36_000, ping, "heading, deg") % 36_000,
        whole(pitch, 0.01, -9_000, 9_000, ping, "pitch, deg"),
        whole(roll, 0.01, -18_000, 18_000, ping, "roll, deg"),
    ]
    sound = whole(ping.sound_speed_mps, 1.0, 1400, 1600, ping, "sound speed, m/s")
    struct.pack_into("<HHHhh", leader, 14, sound, 0, *angles)
    leader[57:65] = bytes([when.year // 100]) + clock
    return bytes(leader)


def _bottom(ping: Ping) -> bytes:
    """The bottom track of 81 bytes, as firmware with ranges beyond 655 m writes it."""
    track = bytearray(81)
    struct.pack_into("<HH", track, 0, 0x0600, 1)
    cm = [
        whole(float(r), 0.01, 1, 0xFFFFFF, ping, f"range of beam {k + 1}, m") if math.isfinite(r) else 0
        for k, r in enumerate(ping.range_m)
    ]
    good = [100 if valid else 0 for valid in ping.valid]
    struct.pack_into(
        "<4H4h4B", track, 16, *(c & 0xFFFF for c in cm), *_velocities(ping), *_correlations(ping)
    )
    track[40:44] = bytes(good)
    track[77:81] = bytes(c >> 16 for c in cm)
    return bytes(track)


def _velocities(ping: Ping) -> list[int]:
    """Of the beams, mm/s."""
    return [
        whole(float(v), 1e-3, -32767, 32767, ping, f"velocity of beam {k + 1}, m/s")
        if math.isfinite(v)
        else BAD
        for k, v in enumerate(ping.beam_velocity_mps)
    ]


def _correlations(ping: Ping) -> list[int]:
    return [_CORRELATION if good else _LOST_CORRELATION for good in ping.valid]


def _water(water: Ping | None) -> list[bytes]:
    """Velocities and correlations of the one cell of a profile."""
    if water is None:
        return []
    return [
        struct.pack("<H4h", 0x0100, *_velocities(water)),
        struct.pack("<H4B", 0x0200, *_correlations(water)),
    ]


def encode(ping: Ping, instrument: Instrument) -> bytes:
    """The ensemble of a ping.

    Raises:
        DataError: for a number that its field does not hold.
    """
    return pd0_wrap([_fixed(ping, instrument), _variable(ping), *_water(ping.of_water), _bottom(ping)])
