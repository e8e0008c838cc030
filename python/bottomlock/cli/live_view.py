"""What `bottomlock live` shows in a terminal: state, beams, velocity, sources and ports, four times a second."""

import asyncio
import math
from collections.abc import Callable, Collection, Iterable, Sequence
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


def _grid(columns: Sequence[str], rows: Iterable[Sequence[str | Text]], numbers: Collection[str]) -> Table:
    """Rows below their heads, numbers to the right."""
    table = Table(box=None, pad_edge=False)
    for name in columns:
        table.add_column(name, justify="right" if name in numbers else "left")
    for row in rows:
        table.add_row(*row)
    return table


def _velocity(shown: dict[str, Any]) -> Table:
    beams = [
        "lost" if beam["velocity_mps"] is None else "used" if beam["used"] else "not used"
        for beam in shown["beams"]
    ]
    names = [f"{axis}, m/s" for axis in ("surge", "sway", "heave")]
    names += [*(f"beam {k}: {word}" for k, word in enumerate(beams, 1)), "NIS"]
    velocity = zip(shown["velocity_mps"], shown["velocity_sd_mps"], strict=True)
    row = [
        *(f"{_number(v)} ± {_number(sd)}" for v, sd in velocity),
        *(_number(beam["velocity_mps"]) for beam in shown["beams"]),
        _number(shown["ping"]["nis"], 2),
    ]
    return _grid(names, [row], names)


def _reference(shown: dict[str, Any]) -> list[Text]:
    off = [
        f"{angle} {math.degrees(error['error_rad']):.2f}° ± {math.degrees(error['sd_rad']):.2f}°"
        for angle, error in shown["reference"].items()
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
    return [Text(f"{what}: {', '.join(values)}") for what, values in parts if values]


def _sources(shown: dict[str, Any]) -> Table:
    rows = []
    for source in shown["sources"]:
        reasons = "; ".join(f"{n} x {why}" for why, n in (source["skipped"] | source["refused"]).items())
        counts = [_number(source["age_s"], 1), str(source["taken"])]
        rows.append([source["name"], Text(source["connection"]), *counts, Text(reasons)])
    return _grid(("source", "connection", "age, s", "taken", "not used"), rows, ("age, s", "taken"))


def _ports(shown: dict[str, Any]) -> Table:
    rows = [
        [
            port["port"],
            Text(f"{port['to']}: {port['target']}"),
            str(port["sent"]),
            Text(port["silent_because"]),
        ]
        for port in shown["ports"]
    ]
    return _grid(("port", "target", "sent", "silent because"), rows, ("sent",))


async def show(status: Callable[[], dict[str, Any]], console: Console) -> None:
    """Shows the status until it is cancelled; lines that are printed meanwhile stand above it."""
    with Screen(view(status()), console=console, auto_refresh=False) as screen:
        while True:
            await asyncio.sleep(REFRESH_S)
            screen.update(view(status()), refresh=True)
