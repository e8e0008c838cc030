"""The layout of Foxglove for an exported MCAP file: map, pose, velocity, sigma, beams and NIS."""

import json
from collections.abc import Sequence
from typing import Any

from bottomlock.figures.palette import stroke
from bottomlock.replay.dive_plots import REFERENCE_COLOUR
from bottomlock.replay.export.foxglove import FRAME
from bottomlock.replay.export.tracks import REFERENCE, ExportTrack


def layout(tracks: Sequence[ExportTrack], beams: int) -> str:
    """A layout to import in Foxglove: the topics of `mcap` for these tracks."""
    estimates = [track for track in tracks if track.what_if]
    first = estimates[0]
    panels: dict[str, dict[str, Any]] = {
        "3D!poses": {
            "followTf": FRAME,
            "topics": {f"/{track.name}/pose": {"visible": True} for track in estimates},
        },
        "Plot!velocity": _plot([f"/{first.name}/estimate.{axis}_mps" for axis in ("surge", "sway", "heave")]),
        "Plot!sigma": _plot(
            [
                f"/{track.name}/estimate.sd_position_{axis}_m"
                for track in estimates
                for axis in ("north", "east")
            ]
        ),
        "Plot!nis": _plot([f"/{first.what_if}_{first.method}/fix.{name}" for name in ("nis", "degrees")]),
        "StateTransitions!beams": {
            "isSynced": True,
            "paths": [
                {
                    "value": f"/{first.what_if}/beams.beam{k + 1}_valid",
                    "timestampMethod": "receiveTime",
                    "label": f"beam {k + 1}",
                }
                for k in range(beams)
            ],
        },
    }
    if first.geodetic is not None:
        panels["map!tracks"] = {
            "topicColors": {f"/{track.name}/location": _colour(track) for track in tracks},
            "disabledTopics": [],
            "followTopic": f"/{first.name}/location",
        }
    left = _column([name for name in ("map!tracks", "3D!poses") if name in panels])
    right = _column(["Plot!velocity", "Plot!sigma", "Plot!nis", "StateTransitions!beams"])
    content = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": left, "second": right},
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


def _colour(track: ExportTrack) -> str:
    return REFERENCE_COLOUR if track.method == REFERENCE else stroke(track.method).colour
