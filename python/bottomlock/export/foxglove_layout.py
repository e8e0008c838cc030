"""The layout of Foxglove for an exported MCAP file: map, pose, velocity, sigma, beams and NIS."""

import json
from collections.abc import Sequence
from typing import Any

from bottomlock.export.foxglove import FRAME
from bottomlock.export.tracks import Export


def foxglove_layout(export: Export) -> str:
    """A layout to import in Foxglove: the topics of `mcap` for these tracks."""
    estimates = export.estimates
    first = estimates[0]
    panels: dict[str, dict[str, Any]] = {}
    if first.geodetic is not None:
        panels["map!tracks"] = {
            "topicColors": {f"/{track.name}/location": track.colour for track in export.tracks},
            "disabledTopics": [],
            "followTopic": f"/{first.name}/location",
        }
    if first.position_t_m is not None:
        panels["3D!poses"] = {
            "followTf": FRAME,
            "topics": {f"/{track.name}/pose": {"visible": True} for track in estimates},
        }
    panels["Plot!velocity"] = _plot(
        [f"/{first.name}/estimate.{axis}_mps" for axis in ("surge", "sway", "heave")]
    )
    of_position = ("sd_position_north_m", "sd_position_east_m")
    of_velocity = ("sd_velocity_surge_mps", "sd_velocity_sway_mps")
    panels["Plot!sigma"] = _plot(
        [
            f"/{track.name}/estimate.{column}"
            for track in estimates
            for column in (of_velocity if track.position_t_m is None else of_position)
        ]
    )
    fix = f"{first.group}_{first.method}"
    if fix in export.fixes:
        panels["Plot!nis"] = _plot([f"/{fix}/fix.{name}" for name in ("nis", "degrees")])
    pings = export.pings.get(first.group)
    if pings is not None:
        panels["StateTransitions!beams"] = {
            "isSynced": True,
            "paths": [
                {
                    "value": f"/{first.group}/beams.{name}",
                    "timestampMethod": "receiveTime",
                    "label": name.removesuffix("_valid").replace("beam", "beam "),
                }
                for name in pings.columns
                if name.endswith("_valid")
            ],
        }
    places = [name for name in panels if name in {"map!tracks", "3D!poses"}]
    curves = _column([name for name in panels if name not in places])
    shown = {"direction": "row", "first": _column(places), "second": curves} if places else curves
    content = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": shown,
    }
    return json.dumps(content, indent=2) + "\n"


def _plot(values: Sequence[str]) -> dict[str, Any]:
    return {
        "isSynced": True,
        "showLegend": True,
        "xAxisVal": "timestamp",
        "paths": [{"value": value, "enabled": True, "timestampMethod": "receiveTime"} for value in values],
    }


def _column(names: Sequence[str]) -> Any:  # noqa: ANN401 - a panel's name or a split, which nests
    """Panels below each other with the same height."""
    if len(names) == 1:
        return names[0]
    return {
        "direction": "column",
        "first": names[0],
        "second": _column(names[1:]),
        "splitPercentage": 100.0 / len(names),
    }
