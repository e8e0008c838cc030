"""Water Linked serial: `wrz` with the velocity, then a `wru` a transducer, each with a CRC-8.

Velocities to 1 mm/s, distances to 1 cm. `wrz` has the time of validity (the reflection at the bottom) and that of
transmission, in µs. Of a ping of which only the water returned the velocity is a `wrs`, which has no altitude. A `wru`
has no flag: a distance of -1 marks a lost beam, so that a beam that returns needs a range.

Source: Water Linked, "DVL serial protocol" 2.4 and 2.7; number of digits from its examples.
"""

import math

from bottomlock.encoders.fields import NO_FOM_MPS, decimal, steps_of
from bottomlock.encoders.framing import waterlinked_sentence
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.encoders.waterlinked_json import NSD_DBM, rssi_dbm
from bottomlock.errors import DataError
from bottomlock.io.columns import LATEST_NS

NAME = "waterlinked-serial"


def _velocity(ping: Ping, *, altitude: bool = True) -> str:
    """The fields of `wrz` behind its name; those of `wrs` without the altitude."""
    velocity, covariance, fom = ping.velocity_p_mps, ping.covariance_m2ps2, ping.figure_mps
    known = velocity is not None and covariance is not None and fom is not None
    rows = [NO_FOM_MPS**2 if k % 4 == 0 else 0.0 for k in range(9)]
    axes = [0.0] * 3
    if velocity is not None and covariance is not None:
        rows, axes = covariance.ravel().tolist(), velocity.tolist()
    fields = [
        *(decimal(v, 3, ping, f"velocity {axis}, m/s") for v, axis in zip(axes, "xyz", strict=True)),
        "y" if known else "n",
        *(
            [decimal(-1.0 if ping.altitude_m is None else ping.altitude_m, 2, ping, "altitude, m")]
            if altitude
            else []
        ),
        decimal(NO_FOM_MPS if fom is None else fom, 3, ping, "figure of merit, m/s"),
        ";".join(f"{value:g}" for value in rows),
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
        raise DataError(
            f"ping {ping.number} at {ping.time_ns} ns: beam {k + 1} has a velocity but no range "
            "(lost, in a wru)",
            expected="a range",
        )
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
