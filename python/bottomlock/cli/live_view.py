"""What `bottomlock live` shows in a terminal: state, beams, velocity, sources and ports, four times a second."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

from rich.console import Console, Group
from rich.live import Live as Screen
from rich.table import Table
from rich.text import Text

REFRESH_S = 0.25
COLOURS = {
    "OK": "green",
    "PARTIAL": "yellow",
    "WATER": "cyan",
    "COASTING": "dark_orange",
    "UNSAFE": "red",
    "INITIALISING": "dim",
}


def view(shown: dict[str, Any]) -> Group:
    """The status of `live.health.status` as a few lines."""
    state = Text.assemble(
        (shown["state"], f"bold {COLOURS[shown['state']]}"),
        f"  {shown['why']}",
        f"  (resets {shown['reset_counter']})",
    )
    return Group(state, _velocity(shown), *_reference(shown), _sources(shown), _ports(shown))


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None or not math.isfinite(value) else f"{value:.{digits}f}"


def _velocity(shown: dict[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("surge", "sway", "heave"):
        table.add_column(f"{name}, m/s", justify="right")
    for k, beam in enumerate(shown["beams"], 1):
        word = "lost" if beam["velocity_mps"] is None else "used" if beam["used"] else "not used"
        table.add_column(f"beam {k}: {word}", justify="right")
    table.add_column("NIS", justify="right")
    velocity = zip(shown["velocity_mps"], shown["velocity_sd_mps"], strict=True)
    table.add_row(
        *(f"{_number(v)} ± {_number(sd)}" for v, sd in velocity),
        *(_number(beam["velocity_mps"]) for beam in shown["beams"]),
        _number(shown["ping"]["nis"], 2),
    )
    return table


def _reference(shown: dict[str, Any]) -> list[Text]:
    off = [
        f"{angle} {math.degrees(one['error_rad']):.2f}° ± {math.degrees(one['sd_rad']):.2f}°"
        for angle, one in shown["reference"].items()
    ]
    gated = [f"{n} x {sensor}" for sensor, n in shown["gated"].items()]
    known = shown["water"] or {"current_mps": (), "current_sd_mps": ()}
    each = zip(("north", "east"), known["current_mps"], known["current_sd_mps"], strict=False)
    water = [f"{axis} {_number(value)} ± {_number(sd)} m/s" for axis, value, sd in each]
    parts = (
        ("slow error of the attitude reference", off),
        ("current", water),
        ("rejected by the gate", gated),
    )
    return [Text(f"{what}: {', '.join(found)}") for what, found in parts if found]


def _sources(shown: dict[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("source", "connection", "age, s", "taken", "not used"):
        table.add_column(name, justify="right" if name in {"age, s", "taken"} else "left")
    for one in shown["sources"]:
        reasons = "; ".join(f"{n} x {why}" for why, n in (one["skipped"] | one["refused"]).items())
        table.add_row(
            one["name"], Text(one["connection"]), _number(one["age_s"], 1), str(one["taken"]), Text(reasons)
        )
    return table


def _ports(shown: dict[str, Any]) -> Table:
    table = Table(box=None, pad_edge=False)
    for name in ("port", "target", "sent", "silent because"):
        table.add_column(name, justify="right" if name == "sent" else "left")
    for one in shown["ports"]:
        target, silent = Text(f"{one['to']}: {one['target']}"), Text(one["silent_because"])
        table.add_row(one["port"], target, str(one["sent"]), silent)
    return table


async def show(status: Callable[[], dict[str, Any]], console: Console) -> None:
    """Shows the status until it is cancelled; lines that are printed meanwhile stand above it."""
    with Screen(view(status()), console=console, auto_refresh=False) as screen:
        while True:
            await asyncio.sleep(REFRESH_S)
            screen.update(view(status()), refresh=True)
