"""`diagnostic_msgs/DiagnosticArray`, as CDR: the state, each source and each port, also while nothing may be used."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from bottomlock.live.config import LiveConfig
from bottomlock.live.health import status
from bottomlock.live.runner import Live
from bottomlock.ports.cdr import CdrWriter
from bottomlock.ports.estimate import State

ROS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR, STALE = range(4)
LEVELS: dict[State, int] = {
    "OK": OK,
    "PARTIAL": WARN,
    "WATER": WARN,
    "COASTING": WARN,
    "INITIALISING": WARN,
    "UNSAFE": ERROR,
}


@dataclass(frozen=True)
class _Status:
    """A `diagnostic_msgs/DiagnosticStatus`; values that are None are left out."""

    level: int
    name: str
    message: str
    values: dict[str, object]

    def put(self, writer: CdrWriter, hardware: str) -> None:
        writer.uint8(self.level)
        for text in (self.name, self.message, hardware):
            writer.string(text)
        known = {key: value for key, value in self.values.items() if value is not None}
        writer.uint32(len(known))
        for key, value in known.items():
            writer.string(key)
            writer.string(f"{value:.6g}" if isinstance(value, float) else str(value))


def _navigation(shown: dict[str, Any]) -> _Status:
    used = [str(number) for number, beam in enumerate(shown["beams"], 1) if beam["used"]]
    axes = zip(("surge", "sway", "heave"), shown["velocity_sd_mps"], strict=True)
    return _Status(
        LEVELS[shown["state"]],
        f"{shown['name']}: navigation",
        f"{shown['state']}: {shown['why']}",
        {
            "state": shown["state"],
            "beams used": " ".join(used) or "none",
            "directions determined": shown["rank"],
            "last ping": shown["ping"]["verdict"],
            "NIS over its degrees": shown["ping"]["nis"],
            "age of the estimate, s": shown["estimate_age_s"],
            **{f"1 sigma of {axis}, m/s": sd for axis, sd in axes},
            "reset counter": shown["reset_counter"],
            "internal errors": shown["internal_errors"],
        },
    )


def _sources(config: LiveConfig, shown: dict[str, Any]) -> Iterator[_Status]:
    for section, one in zip(config.source, shown["sources"], strict=True):
        longest_s = max(config.states.silent_periods / section.rate_hz, config.states.silent_least_s)
        age_s = one["age_s"]
        silent = age_s is None or age_s > longest_s
        lost = sum(one["skipped"].values()) + sum(one["refused"].values())
        yield _Status(
            STALE if silent else WARN if not one["taken"] else OK,
            f"{shown['name']}: source {section.name}",
            "nothing received" if age_s is None else "silent" if silent else "receiving",
            {
                "connection": one["connection"],
                "age, s": age_s,
                "records": one["records"],
                "taken": one["taken"],
                "not taken": lost,
                **{f"skipped: {why}": number for why, number in one["skipped"].items()},
                **{f"refused: {why}": number for why, number in one["refused"].items()},
            },
        )


def _ports(shown: dict[str, Any]) -> Iterator[_Status]:
    for one in shown["ports"]:
        yield _Status(
            WARN if one["silent_because"] else OK,
            f"{shown['name']}: port {one['port']} to {one['to']}",
            one["silent_because"] or "sending",
            {"target": one["target"], "sent": one["sent"], "dropped": one["dropped"]},
        )


def diagnostics(live: Live) -> bytes:
    """The message of a running navigation, now."""
    shown = status(live)
    found = [_navigation(shown), *_sources(live.config, shown), *_ports(shown)]
    writer = CdrWriter()
    writer.header(live.clock(), "")
    writer.uint32(len(found))
    for one in found:
        one.put(writer, shown["name"])
    return bytes(writer)
