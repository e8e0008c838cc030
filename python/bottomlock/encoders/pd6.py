"""Teledyne PD6: text sentences of the instrument's own velocity; it carries no beam velocities.

Our reader rejects it with advice. Without a velocity of its own the instrument says -32768 and V.

Sentences: `:SA` attitude, `:TS` time, `:BI` velocity in instrument axes, `:BS` in ship axes, `:BE` in earth axes where
the attitude is known, `:BD` distance to the bottom (its distances made good are not accumulated and stay 0). Axes are
starboard, forward, up, of the vehicle over the bottom (opposite to PD0's sign), in mm/s. `:TS` is the time of the ping,
to a hundredth of a second. The error velocity is not simulated: none, as in a solution from three beams.

Source: Teledyne RD Instruments, Workhorse Navigator guide, "PD6 output data format".
"""

import math
from collections.abc import Sequence

import numpy as np

from bottomlock.encoders.fields import calendar, decimal, steps_of, whole
from bottomlock.encoders.instrument import Instrument
from bottomlock.encoders.ping import Ping
from bottomlock.io.columns import LATEST_NS

NAME = "pd6"
_NONE = -32768


def _velocity(name: str, axes: Sequence[float] | None, ping: Ping, *, error: bool = False) -> str:
    """A sentence of three velocities (m/s), and of the error velocity in instrument axes."""
    if axes is None:
        numbers, flag = [_NONE] * 3, "V"
    else:
        numbers, flag = [whole(v, 1e-3, -32767, 32767, ping, f":{name}, m/s") for v in axes], "A"
    numbers += [_NONE] * error
    return f":{name},{','.join(f'{v:+6d}' for v in numbers)},{flag}"


def _earth(ping: Ping) -> list[float] | None:
    """Velocity east, north, up; None without attitude or velocity."""
    if ping.velocity_p_mps is None or ping.attitude_rad is None:
        return None
    (sr, sp, sy), (cr, cp, cy) = np.sin(ping.attitude_rad), np.cos(ping.attitude_rad)
    u, v, w = ping.velocity_p_mps
    # Yaw, pitch, roll: platform to north, east, down.
    north = cp * cy * u + (sr * sp * cy - cr * sy) * v + (cr * sp * cy + sr * sy) * w
    east = cp * sy * u + (sr * sp * sy + cr * cy) * v + (cr * sp * sy - sr * cy) * w
    down = -sp * u + sr * cp * v + cr * cp * w
    return [float(east), float(north), float(-down)]


def encode(ping: Ping, instrument: Instrument) -> bytes:
    """The sentences of a ping.

    Raises:
        DataError: for a number that its field does not hold.
    """
    del instrument
    roll, pitch, yaw = (0.0, 0.0, 0.0) if ping.attitude_rad is None else map(math.degrees, ping.attitude_rad)
    when, hundredth = calendar(steps_of(ping.sent_ns, 10_000_000, 0, LATEST_NS // 10_000_000, ping), 100)
    v = ping.velocity_p_mps
    ship = None if v is None else [float(v[1]), float(v[0]), -float(v[2])]
    range_m = 0.0 if ping.altitude_m is None else ping.altitude_m
    sound = decimal(ping.sound_speed_mps, 1, ping, "sound speed, m/s")
    lines = [
        f":SA,{pitch:+6.2f},{roll:+6.2f},{yaw % 360.0:6.2f}",
        f":TS,{when:%y%m%d%H%M%S}{hundredth:02d},35.0,+20.0,   0.0,{sound},  0",
        _velocity("BI", ship, ping, error=True),
        _velocity("BS", ship, ping),
        _velocity("BE", _earth(ping), ping),
        f":BD,{0:+12.2f},{0:+12.2f},{0:+12.2f},{decimal(range_m, 2, ping, 'altitude, m'):>7},  0.00",
    ]
    return "".join(f"{line}\r\n" for line in lines).encode()
