"""The sections of a navigator out of a replay's case: what the filter assumes, without the files that a case reads."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from bottomlock.config.dvl import DvlSettings
from bottomlock.config.imu import ImuLimits
from bottomlock.config.key_reference import section_models
from bottomlock.config.sensors import WaterCells
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.config.validation import checked
from bottomlock.errors import ScenarioError
from bottomlock.live.sections import ImuFromAttitude, ImuSection, LiveSections
from bottomlock.recordings.dvl_sections import DvlStream, WaterTrackStream
from bottomlock.recordings.stream_sections import ImuFromAttitude as AttitudeInertial
from bottomlock.recordings.stream_sections import ImuStream, SensorStreams

_TABLES: dict[str, tuple[type[BaseModel], type[BaseModel]]] = {
    "dvl": (DvlStream, DvlSettings),
    "water_track": (WaterTrackStream, WaterCells),
    **{
        key: (
            section_models(field.annotation)[0],
            section_models(LiveSections.model_fields[key].annotation)[0],
        )
        for key, field in SensorStreams.model_fields.items()
    },
}
"""The sections of a case that have a table, and those of a live configuration that have sources."""
_START = ("level_sd_deg", "heading_sd_deg", "position_sd_m", "velocity_sd_mps")
"""Keys of [start] that are what the filter assumes; the others are of the dive."""


def with_case(content: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """The tables of a live configuration with those of a case.

    Args:
        content: of the configuration, with `mode`.
        path: of the case.

    Raises:
        ScenarioError: for a file that is missing or ill-formed, and a section or key of [start] that both have.
    """
    sections = _sections(
        parse_toml(read_text(path, "replay case"), place=str(path), kind="replay case"), path
    )
    if content.get("mode") == "velocity":
        sections = {"dvl": sections["dvl"]} if "dvl" in sections else {}
    start = sections.pop("start", {})
    twice = [f"[{key}]" for key in sections if key in content]
    own = content.get("start", {})
    twice += [f"start.{key}" for key in start if isinstance(own, Mapping) and key in own]
    if twice:
        raise ScenarioError(
            f"{', '.join(twice)} stands here and in the case {path}", expected="each of them in one file"
        )
    merged = dict(content) | sections
    if isinstance(own, Mapping) and start:
        merged["start"] = start | dict(own)
    return merged


def _sections(case: Mapping[str, Any], path: Path) -> dict[str, Any]:
    named = (*_TABLES, "origin", "filter", "robust", "calibration")
    found = {key: dict(case[key]) for key in named if isinstance(case.get(key), dict)}
    for key in found.keys() & _TABLES.keys():
        found[key] = _without_table(found[key], *_TABLES[key])
    if case.get("gps", {}).get("aids") is False:
        del found["gps"]
    geometry = found.get("dvl", {}).get("geometry")
    if isinstance(geometry, str) and Path(geometry).suffix:
        found["dvl"]["geometry"] = str(path.parent.absolute() / geometry)
    if isinstance(case.get("imu"), dict):
        found["imu"] = _imu(case["imu"], f"{path}: imu")
    if isinstance(case.get("start"), dict):
        found["start"] = {key: case["start"][key] for key in _START if key in case["start"]}
    return found


def _without_table(
    section: Mapping[str, Any], table: type[BaseModel], live: type[BaseModel]
) -> dict[str, Any]:
    """A section without the keys that say how a table is read; the offset of a depth is more, and not of live."""
    of_table = table.model_fields.keys() - live.model_fields.keys() - {"offset_m"}
    return {key: value for key, value in section.items() if key not in of_table}


def _imu(section: Mapping[str, Any], place: str) -> dict[str, Any]:
    """[imu] with the keys of its errors beside the others.

    `bridge_gaps_s` becomes the least `limits.max_gap_s`; `limits.gap` is left out, since live use bridges every gap.
    """
    if section.get("source") == "attitude":
        kept = _without_table(section, AttitudeInertial, ImuFromAttitude)
    else:
        kept = _without_table(section, ImuStream, ImuSection)
        kept |= {"sampling": "averaged"} if checked(ImuStream, section, place).averaged else {}
    kept |= section.get("errors", {})
    limits = {key: value for key, value in section.get("limits", {}).items() if key != "gap"}
    if "bridge_gaps_s" in section:
        limits["max_gap_s"] = max(limits.get("max_gap_s", ImuLimits().max_gap_s), section["bridge_gaps_s"])
    return kept | ({"limits": limits} if limits else {})
