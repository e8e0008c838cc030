"""Nortek DVL500 and DVL1000: the bottom-track record of DF21 (id 0x1B) and, with water, that of water track (0x1D).

Numbers are 32-bit floats; status bits say which velocities, distances and figures of merit are valid, of each beam and
each axis; what is not holds Nortek's marks (-32.768 m/s, 0 m, 10 m/s). Distances are vertical. The clock is that of the
trigger, to 100 µs; DT1 leads from there to the centre of a beam's echo, DT2 back to it from the sending.

Source: the manufacturer's published structure; DT1 and DT2 as its drivers describe them.
"""

import math
import struct
from collections.abc import Callable

from bottomlock.encoders.fields import NO_FOM_MPS, calendar, single, steps_of, whole
from bottomlock.encoders.framing import nortek_frame
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.io.columns import LATEST_NS
from bottomlock.io.nortek_ascii import NO_VELOCITY_MPS, TILT_RAD

_FAMILY = 0x16
_VELOCITY, _DISTANCE, _FOM = 0, 4, 8
_AXES, _AXES_FOM = 12, 16
_LEAST, _MOST = -32_765, 32_765
_SERIAL = 4711


def beam_velocity(ping: Ping, k: int) -> float:
    """Velocity of a beam, or the mark for none; what lies as far out as the mark is an error."""
    value = float(ping.beam_velocity_mps[k])
    if not math.isfinite(value):
        return NO_VELOCITY_MPS
    whole(value, 1e-3, _LEAST, _MOST, ping, f"velocity of beam {k + 1}, m/s")
    return value


def beam_range(ping: Ping, k: int) -> float:
    """Range of a beam, 0 for none."""
    value = float(ping.range_m[k])
    return single(value, ping, f"range of beam {k + 1}, m") if math.isfinite(value) else 0.0


def echo_s(ping: Ping, k: int) -> float:
    """Seconds from the trigger to the centre of a beam's echo; 0 where there is none."""
    return 2.0 * beam_range(ping, k) / ping.sound_speed_mps


def axes_and_fom(ping: Ping) -> tuple[list[float], list[float], bool]:
    """The instrument's velocity (3), its figures of merit (3), and whether there is one."""
    if ping.velocity_p_mps is None or ping.covariance_m2ps2 is None:
        return [NO_VELOCITY_MPS] * 3, [NO_FOM_MPS] * 3, False
    velocity = [float(v) for v in ping.velocity_p_mps]
    for v in velocity:
        whole(v, 1e-3, _LEAST, _MOST, ping, "velocity, m/s")
    return velocity, [math.sqrt(max(float(v), 0.0)) for v in ping.covariance_m2ps2.diagonal()], True


def _both(values: list[float]) -> list[float]:
    """Numbers of x, y, z1, z2 from those of x, y, z."""
    return [*values, values[2]]


def bottom_and_water(
    record: Callable[[int, Ping], bytes], bottom: int, water: int
) -> Callable[[Ping, Instrument], bytes]:
    """An encoder of the record of a ping, and that of its water, by the ids of both.

    It raises DataError for a velocity as far out as the mark for none, and for a time outside the record's clock.
    """

    def encode(ping: Ping, _: Instrument) -> bytes:
        of_water = ping.of_water
        return record(bottom, ping) + (b"" if of_water is None else record(water, of_water))

    return encode


def _record(kind: int, ping: Ping) -> bytes:
    """A record of the layout that bottom and water share."""
    when, rest = calendar(steps_of(ping.sent_ns, 100_000, 0, LATEST_NS // 100_000, ping), 10_000)
    clock = bytes([when.year - 1900, when.month - 1, when.day, when.hour, when.minute, when.second])
    beams = range(4)
    axes, axes_fom, known = axes_and_fom(ping)
    ranges = [beam_range(ping, k) for k in beams]
    status = 0xF << _AXES | 0xF << _AXES_FOM if known else 0
    for k in beams:
        status |= int(ping.valid[k]) << _VELOCITY + k | int(ping.valid[k]) << _FOM + k
        status |= int(ranges[k] > 0.0) << _DISTANCE + k
    echoes = [echo_s(ping, k) for k in beams]
    sent_s = (ping.transmission_ns - ping.sent_ns) * 1e-9
    mean = sum(echoes) / 4
    numbers = [
        *(beam_velocity(ping, k) for k in beams),
        *(r * math.cos(TILT_RAD) for r in ranges),
        *(ping.beam_sd_mps if good else NO_FOM_MPS for good in ping.valid),
        *echoes,
        *(echo - sent_s for echo in echoes),
        *[0.0] * 4,
        *_both(axes),
        *_both(axes_fom),
        *[mean] * 4,
        *[mean - sent_s] * 4,
        *[0.0] * 4,
    ]
    head = struct.pack(
        "<BBI6sHHII3f", 1, 36, _SERIAL, clock, rest, 4, 0, status, ping.sound_speed_mps, 12.0, 1.0
    )
    return nortek_frame(kind, head + struct.pack("<44f", *numbers), _FAMILY)


encode = bottom_and_water(_record, 0x1B, 0x1D)
