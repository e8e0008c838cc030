"""Water Linked over TCP: one JSON object a line, `json_v3.3`.

`time_of_validity` is the reflection at the bottom, `time_of_transmission` the moment before sending, both µs. Numbers
are written with all their digits. A lost beam has velocity 0 and distance -1, as recorded. A line ends with a carriage
return and a line feed, where the maker's own client splits. A ping of which only the water returned is a report of
water tracking.

Source: Water Linked, "DVL TCP JSON API", json_v3.3; key order and marks from its example and from a recorded A50.
"""

import json
import math
from collections.abc import Callable
from typing import Any

from bottomlock.encoders.fields import NO_FOM_MPS, decimal, steps_of
from bottomlock.encoders.ping import Instrument, Ping
from bottomlock.io.columns import LATEST_NS

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


def stated(ping: Ping) -> tuple[list[float], list[list[float]], float, bool]:
    """Velocity, covariance, figure of merit, and whether the instrument calls them valid; else what stands for none."""
    velocity, covariance, fom = ping.velocity_p_mps, ping.covariance_m2ps2, ping.figure_mps
    if velocity is None or covariance is None or fom is None:
        none = [[NO_FOM_MPS**2 if i == j else 0 for j in range(3)] for i in range(3)]
        return [0.0] * 3, none, NO_FOM_MPS, False
    return velocity.tolist(), covariance.tolist(), fom, True


def encode(ping: Ping, instrument: Instrument) -> bytes:
    """The report of a ping, with its line end.

    Raises:
        DataError: for a number that is no measurement, and for times before 1970.
    """
    del instrument
    water = ping.of_water_alone
    ping = ping if water is None else water
    axes, rows, fom, known = stated(ping)
    report = {
        "time": ping.interval_ns / 1e6,
        **dict(zip(("vx", "vy", "vz"), axes, strict=True)),
        "fom": fom,
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
    return _line(report)


def _line(content: dict[str, Any]) -> bytes:
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode() + b"\r\n"


MOST_BYTES = 4096
"""Of commands that wait for their end."""
LONGEST_MODE = 16
"""Characters of a range mode, as "auto", "=2", "1<=3": every client is told it."""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


_CONFIG: dict[str, tuple[Any, Callable[[Any], bool]]] = {
    "speed_of_sound": (1500.0, lambda value: _is_number(value) and 1000.0 <= value <= 2000.0),
    "acoustic_enabled": (True, lambda value: value is True),
    "dark_mode_enabled": (False, lambda value: isinstance(value, bool)),
    "mounting_rotation_offset": (0.0, lambda value: _is_number(value) and value == 0),
    "range_mode": ("auto", lambda value: isinstance(value, str) and len(value) <= LONGEST_MODE),
    "periodic_cycling_enabled": (True, lambda value: isinstance(value, bool)),
}
"""What a client may set, as it is at the start, and to what: nothing that would change what is sent."""


class Commands:
    """The instrument's side of its commands, `{"command": NAME, "parameters": {...}}`.

    A configuration is checked, kept and told to every client; what is sent stays as it is. So what would change it, a
    rotation of the mounting or pings on request, fails with the reason.
    """

    def __init__(self) -> None:
        self.config = {key: first for key, (first, _) in _CONFIG.items()}

    def client(self) -> Callable[[bytes], bytes]:
        """What answers the bytes of one client; its commands may stand without anything between them."""
        held = ""

        def answers(data: bytes) -> bytes:
            nonlocal held
            held = (held + data.decode("utf-8", "replace"))[-MOST_BYTES:].lstrip()
            found = b""
            while held:
                try:
                    command, end = json.JSONDecoder().raw_decode(held)
                except (ValueError, RecursionError):
                    _, newline, rest = held.partition("\n")
                    if not newline:
                        break
                    command, end = None, len(held) - len(rest)
                found += self._answer(command if isinstance(command, dict) else {})
                held = held[end:].lstrip()
            return found

        return answers

    def _answer(self, command: dict[str, Any]) -> bytes:
        name, fault = str(command.get("command", "")), ""
        if name == "set_config":
            fault = self.configure(command.get("parameters"))
        elif name not in {"get_config", "calibrate_gyro", "reset_dead_reckoning"}:
            fault = "the instrument pings by itself" if name == "trigger_ping" else "no such command"
        result = self.config if name == "get_config" else None
        known = {"success": not fault, "error_message": fault, "result": result}
        return _line({"response_to": name[:80]} | known | {"format": FORMAT, "type": "response"})

    def configure(self, parameters: Any) -> str:  # noqa: ANN401 - whatever came
        """Takes a configuration, all of it or nothing; why not, "" where it is taken."""
        if not isinstance(parameters, dict):
            return "no parameters"
        for key, value in parameters.items():
            if key not in _CONFIG or not _CONFIG[key][1](value):
                return f"{key[:40]} cannot be {str(value)[:40]} here"
        self.config |= parameters
        return ""
