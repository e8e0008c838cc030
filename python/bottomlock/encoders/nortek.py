"""Nortek: the bottom-track record of a DVL500 or DVL1000 (DF21) or a Nucleus1000, and, with water, of water track.

Their fields, and the order of the status bits, are those of the readers. Numbers are 32-bit floats; what is not valid
holds Nortek's marks (-32.768 m/s, 0 m, 10 m/s). The clock is that of the trigger; DT1 leads from there to the centre of
a beam's echo, DT2 of a DVL back to it from the sending.

Source: the manufacturer's published structure and its drivers.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from bottomlock.encoders.fields import NO_FOM_MPS, calendar, single, steps_of, whole
from bottomlock.encoders.framing import nortek_frame
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.io import nortek_dvl, nucleus
from bottomlock.io.columns import LATEST_NS
from bottomlock.io.nortek_ascii import NO_VELOCITY_MPS

_LEAST, _MOST = -32_765, 32_765
_SERIAL, _POSIX = 4711, 1
_LATEST_US = 2**32 * 1_000_000 - 1


def _velocity(value: float, ping: Ping, what: str) -> float:
    """A velocity, or the mark for none; what lies as far out as the mark is an error."""
    if not math.isfinite(value):
        return NO_VELOCITY_MPS
    whole(value, 1e-3, _LEAST, _MOST, ping, what)
    return value


def _dvl_head(ping: Ping) -> tuple[int, dict[str, Any]]:
    """Family of a DVL, and the fields of its clock, to 100 µs."""
    when, rest = calendar(steps_of(ping.sent_ns, 100_000, 0, LATEST_NS // 100_000, ping), 10_000)
    clock = [when.year - 1900, when.month - 1, when.day, when.hour, when.minute, when.second]
    return 0x16, {"version": 1, "clock": clock, "hundred_us": rest, "beams": 4}


def _nucleus_head(ping: Ping) -> tuple[int, dict[str, Any]]:
    """Family of a Nucleus, and the fields of its clock, s and µs since 1970."""
    seconds, micros = divmod(steps_of(ping.sent_ns, 1000, 0, _LATEST_US, ping), 1_000_000)
    return 0x20, {"version": 2, "flags": _POSIX, "seconds": seconds, "micros": micros}


def _record(kind: int, ping: Ping, layout: nortek_dvl.Layout) -> bytes:
    """A record of the fields that bottom and water share."""
    family, known = (_dvl_head if layout is nortek_dvl.LAYOUT else _nucleus_head)(ping)
    beams, axes = range(layout.beams), layout.fields["axes"].shape[0]
    ranges = [
        single(float(one), ping, f"range of beam {k + 1}, m") if math.isfinite(one) else 0.0
        for k, one in enumerate(ping.range_m)
    ]
    echoes_s = np.array([2.0 * one / ping.sound_speed_mps for one in ranges])
    sent_s, mean_s = (ping.transmission_ns - ping.sent_ns) * 1e-9, echoes_s.sum() / layout.beams
    velocity, covariance = ping.velocity_p_mps, ping.covariance_m2ps2
    own, own_fom, has_own = [NO_VELOCITY_MPS] * 3, [NO_FOM_MPS] * 3, velocity is not None
    if velocity is not None and covariance is not None:
        own = [_velocity(float(one), ping, "velocity, m/s") for one in velocity]
        own_fom = [math.sqrt(max(float(one), 0.0)) for one in covariance.diagonal()]
    flags = [*ping.valid, *(one > 0.0 for one in ranges), *ping.valid, *[has_own] * (2 * axes)]
    record = np.zeros(1, dtype=layout.fields)[0]
    known |= {
        "offset": 36,
        "serial": _SERIAL,
        "status": sum(int(flag) << k for k, flag in enumerate(flags)),
        "sound": ping.sound_speed_mps,
        "temperature": 12.0,
        "pressure": 1.0,
        "velocity": [
            _velocity(float(ping.beam_velocity_mps[k]), ping, f"velocity of beam {k + 1}, m/s") for k in beams
        ],
        "distance": np.array(ranges) * math.cos(layout.tilt_rad or 0.0),
        "fom": [ping.beam_sd_mps if good else NO_FOM_MPS for good in ping.valid],
        "delay": echoes_s,
        # Of a DVL z1 and z2, and behind them DT1 and DT2 of the axes.
        "axes": (own + own[2:])[:axes],
        "axes_fom": (own_fom + own_fom[2:])[:axes],
        "rest": [mean_s, 0.0],
    }
    if "delay_2" in (layout.fields.names or ()):
        known |= {"delay_2": echoes_s - sent_s, "rest": [mean_s] * 4 + [mean_s - sent_s] * 4 + [0.0] * 4}
    for name, value in known.items():
        record[name] = value
    return nortek_frame(kind, record.tobytes(), family)


def _encoder(layout: nortek_dvl.Layout) -> Callable[[Ping, Instrument], bytes]:
    """An encoder of the record of a ping, and that of its water.

    It raises DataError for a velocity as far out as the mark for none, and for a time outside the record's clock.
    """

    def encode(ping: Ping, _: Instrument) -> bytes:
        water = ping.of_water
        return _record(layout.bottom, ping, layout) + (
            b"" if water is None else _record(layout.water, water, layout)
        )

    return encode


dvl, nucleus1000 = _encoder(nortek_dvl.LAYOUT), _encoder(nucleus.LAYOUT)
