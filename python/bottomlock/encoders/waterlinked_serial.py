"""Water Linked serial: `wrz` with the velocity, then a `wru` a transducer, each with a CRC-8.

Velocities to 1 mm/s, distances to 1 cm. `wrz` has the time of validity (the reflection at the bottom) and that of
transmission, in µs. Of a ping of which only the water returned the velocity is a `wrs`, which has no altitude. A `wru`
has no flag: a distance of -1 marks a lost beam, so that a beam that returns needs a range.

Source: Water Linked, "DVL serial protocol" 2.4 and 2.7; number of digits from its examples.
"""

import math
from collections.abc import Callable
from typing import Any

from bottomlock.encoders.fields import decimal, steps_of
from bottomlock.encoders.framing import crc8, waterlinked_sentence
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.encoders.waterlinked_json import MOST_BYTES, NSD_DBM, Commands, rssi_dbm, stated
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


_DONE, _FAILED, _MALFORMED, _DAMAGED = b"wra", b"wrn", b"wr?", b"wr!"
_TOLD = {
    b"wcv": b"wrv,2,6,0",
    b"wcw": b"wrw,bottomlock,2.6.1,0x0",
    b"wcr": _DONE,
    b"wcg": _DONE,
    b"wcx": _FAILED,
}
_KEYS = (
    "speed_of_sound", "mounting_rotation_offset", "acoustic_enabled", "dark_mode_enabled", "range_mode",
    "periodic_cycling_enabled",
)  # fmt: skip
_ORDER = {"y": True, "n": False}


class SerialCommands(Commands):
    """The same commands as sentences: `wcv`, `wcw`, `wcc`, `wcs`, `wcr`, `wcg`, `wcx`, their checksums optional."""

    def client(self) -> Callable[[bytes], bytes]:
        """What answers the bytes of one client."""
        held = b""

        def answers(data: bytes) -> bytes:
            nonlocal held
            *lines, held = (held + data).replace(b"\r", b"\n").split(b"\n")
            held = held[-MOST_BYTES:]
            return b"".join(waterlinked_sentence(self._reply(line)) for line in lines if line)

        return answers

    def _reply(self, line: bytes) -> bytes:
        text, star, digits = line.partition(b"*")
        if star and digits.lower() != b"%02x" % crc8(text):
            return _DAMAGED
        name, *values = text.split(b",")
        if name == b"wcc" and not values:
            known = [self.config[key] for key in _KEYS]
            shown = [("n", "y")[value] if isinstance(value, bool) else str(value) for value in known]
            return ",".join(["wrc", *shown]).encode()
        if name != b"wcs":
            return _MALFORMED if values else _TOLD.get(name, _MALFORMED)
        try:
            given = dict(zip(_KEYS, (value.decode() for value in values), strict=False))
            parameters: dict[str, Any] = {key: _ORDER.get(text, text) for key, text in given.items() if text}
            parameters |= {key: float(given[key]) for key in _KEYS[:2] if given.get(key)}
        except ValueError:
            return _MALFORMED
        if not 4 <= len(values) <= len(_KEYS) + 1:
            return _MALFORMED
        return _FAILED if self.configure(parameters) else _DONE
