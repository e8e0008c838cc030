"""`diagnostic_msgs/DiagnosticArray`, as CDR: the state, each source and each port, also while nothing may be used."""

from collections.abc import Iterator
from typing import Any

from bottomlock.live.config import LiveConfig
from bottomlock.live.health import leaves, status
from bottomlock.live.runner import Live
from bottomlock.ports.cdr import CdrWriter

ROS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)
LEVELS = {"OK": OK, "UNSAFE": ERROR}
"""Of the states; the others are a warning."""
_Status = tuple[int, str, str, dict[str, Any]]
"""A `diagnostic_msgs/DiagnosticStatus`: level, name, message, values."""


def _statuses(config: LiveConfig, shown: dict[str, Any]) -> Iterator[_Status]:
    own = {key: value for key, value in shown.items() if key not in {"sources", "ports"}}
    level = LEVELS.get(shown["state"], WARN)
    yield level, f"{shown['name']}: navigation", f"{shown['state']}: {shown['why']}", own
    for section, one in zip(config.source, shown["sources"], strict=True):
        longest_s = max(config.states.silent_periods / section.rate_hz, config.states.silent_least_s)
        age_s = one["age_s"]
        silent = age_s is None or age_s > longest_s
        level = STALE if silent else OK if one["taken"] else WARN
        words = "nothing received" if age_s is None else "silent" if silent else "receiving"
        yield level, f"{shown['name']}: source {section.name}", words, one
    for one in shown["ports"]:
        silent_because = one["silent_because"]
        name = f"{shown['name']}: port {one['port']} to {one['to']}"
        yield WARN if silent_because else OK, name, silent_because or "sending", one


def diagnostics(live: Live) -> bytes:
    """The message of a running navigation, now."""
    shown = status(live)
    found = list(_statuses(live.config, shown))
    writer = CdrWriter()
    writer.header(live.clock(), "")
    writer.uint32(len(found))
    for level, name, message, values in found:
        writer.uint8(level)
        for text in (name, message, shown["name"]):
            writer.string(text)
        known = [(" ".join((key, *labels.values())), value) for key, labels, value in leaves(values)]
        writer.uint32(len(known))
        for key, value in known:
            writer.string(key)
            writer.string(f"{value:.6g}" if isinstance(value, float) else str(value))
    return bytes(writer)
