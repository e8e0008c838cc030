"""Water Linked serial: `wrz` with the velocity, then a `wru` a transducer, each with a CRC-8.

Velocities to 1 mm/s, distances to 1 cm. `wrz` has the time of validity (the reflection at the bottom) and that of
transmission, in µs. Of a ping of which only the water returned the velocity is a `wrs`, which has no altitude. A `wru`
has no flag: a distance of -1 marks a lost beam, so that a beam that returns needs a range.

Source: Water Linked, "DVL serial protocol" 2.4 and 2.7; number of digits from its examples.
"""

import math

from bottomlock.encoders.fields import decimal, steps_of
from bottomlock.encoders.framing import waterlinked_sentence
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.encoders.waterlinked_json import NSD_DBM, rssi_dbm, stated
from bottomlock.io.columns import LATEST_NS


def _velocity(ping: Ping, *, altitude: bool = True) -> str:
    """The fields of `wrz` behind its name; those of `wrs` without the altitude."""
    axes, rows, fom, known = stated(ping)
    altitude_m = -1.0 if ping.altitude_m is None else ping.altitude_m
    fields = [
        *(decimal(v, 3, ping, f"velocity {axis}, m/s") for v, axis in zip(axes, "xyz", strict=True)),
        "y" if known else "n",
        *([decimal(altitude_m, 2, ping, "altitude, m")] if altitude else []),
        decimal(fom, 3, ping, "figure of merit, m/s"),
        ";".join(f"{value:g}" for row in rows for value in row),
        *(str(steps_of(t, 1000, 1, LATEST_NS // 1000, ping)) for t in (ping.time_ns, ping.transmission_ns)),
        decimal(ping.interval_ns / 1e6, 2, ping, "interval, ms"),
        "0",
    ]
    return ",".join(fields)


def _transducer(ping: Ping, k: int) -> str:
    """The fields of `wru` behind its name."""
    velocity, distance = float(ping.beam_velocity_mps[k]), float(ping.range_m[k])
    if not math.isfinite(velocity):
        velocity, distance = 0.0, -1.0
    elif not math.isfinite(distance):
        raise ping.fault(f"beam {k + 1} has a velocity but no range (lost, in a wru)", expected="a range")
    v = decimal(velocity, 3, ping, f"velocity of beam {k + 1}, m/s")
    r = decimal(distance, 2, ping, f"range of beam {k + 1}, m")
    return f"{k},{v},{r},{rssi_dbm(ping):g},{NSD_DBM:g}"


def encode(ping: Ping, instrument: Instrument) -> bytes:
    """The five sentences of a ping.

    Raises:
        DataError: for a beam that returns without a range, a number that is no measurement, a time before 1970.
    """
    del instrument
    water = ping.of_water_alone
    ping = ping if water is None else water
    lines = [
        f"wrz,{_velocity(ping)}" if water is None else f"wrs,{_velocity(ping, altitude=False)}",
        *(f"wru,{_transducer(ping, k)}" for k in range(ping.beams)),
    ]
    return b"".join(waterlinked_sentence(line.encode()) for line in lines)
