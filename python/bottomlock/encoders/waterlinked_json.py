"""Water Linked over TCP: one JSON object a line, `json_v3.3`.

`time_of_validity` is the reflection at the bottom, `time_of_transmission` the moment before sending, both µs. Numbers
are written with all their digits. A lost beam has velocity 0 and distance -1, as recorded. A line ends with a carriage
return and a line feed, where the maker's own client splits. A ping of which only the water returned is a report of
water tracking.

Source: Water Linked, "DVL TCP JSON API", json_v3.3; key order and marks from its example and from a recorded A50.
"""

import json
import math
from typing import Any

from bottomlock.encoders.fields import NO_FOM_MPS, decimal, steps_of
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.io.columns import LATEST_NS

NAME = "waterlinked-json"
FORMAT = "json_v3.3"
_RSSI_DBM, NSD_DBM = -40.0, -95.0


def rssi_dbm(ping: Ping) -> float:
    """Signal strength, which is not simulated: it changes from ping to ping, so that like pings are no repeat."""
    return _RSSI_DBM - 0.125 * (ping.number % 16)


def _number(value: float, ping: Ping, what: str) -> float:
    decimal(value, 0, ping, what)
    return float(value)


def _transducer(ping: Ping, k: int) -> dict[str, Any]:
    velocity, distance = float(ping.beam_velocity_mps[k]), float(ping.range_m[k])
    valid = math.isfinite(velocity)
    return {
        "id": k,
        "velocity": _number(velocity, ping, f"velocity of beam {k + 1}") if valid else 0,
        "distance": _number(distance, ping, f"range of beam {k + 1}") if math.isfinite(distance) else -1,
        "rssi": rssi_dbm(ping),
        "nsd": NSD_DBM,
        "beam_valid": valid,
    }


def encode(ping: Ping, instrument: Instrument) -> bytes:
    """The report of a ping, with its line end.

    Raises:
        DataError: for a number that is no measurement, and for times before 1970.
    """
    del instrument
    water = ping.of_water_alone
    ping = ping if water is None else water
    velocity, covariance, fom = ping.velocity_p_mps, ping.covariance_m2ps2, ping.figure_mps
    known = velocity is not None and covariance is not None and fom is not None
    rows = [[NO_FOM_MPS**2 if i == j else 0 for j in range(3)] for i in range(3)]
    axes = [0.0] * 3
    if velocity is not None and covariance is not None:
        rows, axes = covariance.tolist(), velocity.tolist()
    report = {
        "time": ping.interval_ns / 1e6,
        **dict(zip(("vx", "vy", "vz"), axes, strict=True)),
        "fom": fom if known else NO_FOM_MPS,
        "covariance": rows,
        "altitude": -1 if ping.altitude_m is None else ping.altitude_m,
        "transducers": [_transducer(ping, k) for k in range(ping.beams)],
        "velocity_valid": known,
        "status": 0,
        "tracking_mode": "bottom" if water is None else "water",
        "format": FORMAT,
        "type": "velocity" if water is None else "velocity_water",
        "time_of_validity": steps_of(ping.time_ns, 1000, 1, LATEST_NS // 1000, ping),
        "time_of_transmission": steps_of(ping.transmission_ns, 1000, 1, LATEST_NS // 1000, ping),
    }
    return json.dumps(report, separators=(",", ":"), allow_nan=False).encode() + b"\r\n"
