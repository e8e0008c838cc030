"""The sections of a navigator out of a replay's case: what the filter assumes, without the files that a case reads."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bottomlock.config.imu import ImuLimits
from bottomlock.config.toml_file import parse_toml, read_text
from bottomlock.errors import ScenarioError
from bottomlock.recordings.sensors import SENSORS

_OF_FILES = {
    "file", "clock", "every", "source", "column", "unit", "up", "valid", "interval", "geometry_known", "aids", "sd",
    "heading_known", "force", "omega", "force_unit", "omega_unit", "velocity", "velocity_unit", "velocity_scale",
    "angle_unit", "roll", "pitch", "yaw", "latitude", "longitude", "height", "north", "east", "down",
}  # fmt: skip
"""Keys of a case that say how a table is read, which live sources are not."""
_START = ("level_sd_deg", "heading_sd_deg", "position_sd_m", "velocity_sd_mps")
"""Keys of [start] that are what the filter assumes; the others are of the dive."""
_INCREMENTS = {"m/s", "rad", "deg"}
"""Units of inertial readings that are means over their interval."""


def with_case(content: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """The tables of a live configuration with those of a case.

    Args:
        content: of the configuration, with `mode`.
        path: of the case.

    Raises:
        ScenarioError: for a file that is missing or ill-formed, and a section or key of [start] that both have.
    """
    if not path.is_file():
        raise ScenarioError("no such case file", place=path)
    sections = _sections(parse_toml(read_text(path), place=str(path), kind="replay case"), path.parent)
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


def _sections(case: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    found = {
        key: {name: value for name, value in case[key].items() if _is_kept(key, name)}
        for key in ("dvl", "origin", *(sensor.name for sensor in SENSORS), "filter", "robust", "calibration")
        if isinstance(case.get(key), dict)
    }
    if case.get("gps", {}).get("aids") is False:
        del found["gps"]
    geometry = found.get("dvl", {}).get("geometry")
    if isinstance(geometry, str) and geometry.endswith(".toml"):
        found["dvl"]["geometry"] = str(folder / geometry)
    if isinstance(case.get("imu"), dict):
        found["imu"] = _imu(case["imu"])
    if isinstance(case.get("start"), dict):
        found["start"] = {key: case["start"][key] for key in _START if key in case["start"]}
    return found


def _is_kept(section: str, key: str) -> bool:
    """Whether a key is one of the filter's; `aids` of an attitude is, and the axes of a velocity are not."""
    if key == "aids":
        return section == "attitude"
    return key not in _OF_FILES and not (section == "dvl" and key == "axes")


def _imu(section: Mapping[str, Any]) -> dict[str, Any]:
    """[imu] with the keys of its errors beside the others.

    `bridge_gaps_s` becomes the least `limits.max_gap_s`; `limits.gap` is left out, since live use bridges every gap.
    """
    kept = {
        key: value for key, value in section.items() if key not in _OF_FILES | {"errors", "bridge_gaps_s"}
    }
    kept |= section.get("errors", {})
    if section.get("source") == "attitude":
        kept["source"] = "attitude"
    elif "sampling" not in kept and _INCREMENTS & {section.get("force_unit"), section.get("omega_unit")}:
        kept["sampling"] = "averaged"
    limits = {key: value for key, value in section.get("limits", {}).items() if key != "gap"}
    if "bridge_gaps_s" in section:
        limits["max_gap_s"] = max(limits.get("max_gap_s", ImuLimits().max_gap_s), section["bridge_gaps_s"])
    return kept | ({"limits": limits} if limits else {})
