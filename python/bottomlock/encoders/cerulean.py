"""Cerulean Tracker 650: `$DVKFC`, three cones with range, velocity and their confidences.

Six decimals. A cone has no flag: a range confidence below 25 marks a false detection. `tod` is the instrument's clock,
seconds since it was switched on, at the ping. The sentence has no velocity of the instrument's own.

Source: Cerulean Sonar, Tracker 650, "$DVKFC"; checksum as in its example.
"""

import math

from bottomlock.encoders.fields import decimal, steps_of
from bottomlock.encoders.framing import cerulean_sentence
from bottomlock.encoders.ping import Instrument, Ping

_RANGE_CONFIDENCE, _LOST_CONFIDENCE, _VELOCITY_CONFIDENCE = 80.0, 4.0, 6.283185
_LATEST_US = 10**15 - 1


def _cone(ping: Ping, k: int) -> str:
    velocity, range_m = float(ping.beam_velocity_mps[k]), float(ping.range_m[k])
    valid = math.isfinite(velocity)
    numbers = (
        range_m if math.isfinite(range_m) else 0.0,
        _RANGE_CONFIDENCE if valid else _LOST_CONFIDENCE,
        velocity if valid else 0.0,
        _VELOCITY_CONFIDENCE,
    )
    return f"[{'ABC'[k]}],60,1000," + ",".join(decimal(v, 6, ping, f"beam {k + 1}") for v in numbers)


def encode(ping: Ping, instrument: Instrument) -> bytes:
    """The sentence of a ping.

    Raises:
        DataError: for a number that is no measurement, and a time before the instrument was switched on.
    """
    micros = steps_of(ping.sent_ns - instrument.start_ns, 1000, 0, _LATEST_US, ping)
    tod = f"{micros // 1_000_000}.{micros % 1_000_000:06d}"
    cones = ",".join(_cone(ping, k) for k in range(3))
    text = f"DVKFC,24577,{ping.number - 1},{ping.interval_ns / 1e9:.6f},{tod},{cones},0x0055AAFF"
    return cerulean_sentence(text.encode())
