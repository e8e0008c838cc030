"""The command `bottomlock keys`: every key of the files that a user writes, and their JSON schemas."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from bottomlock.cli.console import print_json, say
from bottomlock.errors import ScenarioError
from bottomlock.text import did_you_mean

if TYPE_CHECKING:
    from pydantic import BaseModel

    from bottomlock.config.key_reference import Key, KeySection

Kind = Literal["scenario", "case", "geometry", "vehicle", "hovering_vehicle", "columns", "live"]


def models() -> dict[Kind, type[BaseModel]]:
    """The model of each kind of file."""
    from bottomlock.config.scenario import Scenario
    from bottomlock.io.beams import Columns, InstrumentFile
    from bottomlock.live.config import LiveConfig
    from bottomlock.plant import HoveringVehicle, Vehicle
    from bottomlock.replay.case import Case

    return {
        "scenario": Scenario, "case": Case, "geometry": InstrumentFile, "vehicle": Vehicle,
        "hovering_vehicle": HoveringVehicle, "columns": Columns, "live": LiveConfig,
    }  # fmt: skip


def keys(
    kind: Kind,
    word: str = "",
    /,
    *,
    as_json: Annotated[bool, Parameter(name="--json")] = False,
    schema: bool = False,
) -> None:
    """Print every key of a scenario, case, geometry, vehicle, column map or live file, or its JSON schema.

    Args:
        kind: Which file: scenario, case, geometry, vehicle, hovering_vehicle, columns (column map) or live.
        word: Only sections and keys whose name contains it.
        as_json: Print JSON.
        schema: Print the JSON schema by which an editor completes and checks the file.
    """
    if schema:
        if word:
            raise ScenarioError(
                "a schema is that of the whole file",
                place=f"'{word}' beside --schema",
                hint="leave one of them out",
            )
        dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
        content = dialect | models()[kind].model_json_schema()
        print_json(content, sort_keys=False)
        return
    sections = matching(reference(kind), word)
    if not sections:
        names = {
            part
            for section in reference(kind)
            for part in (section.path, *(key.name for key in section.keys))
        }
        hint = did_you_mean(word, sorted(names))
        raise ScenarioError(f"no section or key of a {kind} file contains '{word}'{hint}")
    if as_json:
        print_json([_content(section) for section in sections], sort_keys=False)
        return
    for section in sections:
        say(_words(section))


def reference(kind: Kind) -> list[KeySection]:
    """The sections of a kind of file."""
    from bottomlock.config.key_reference import sections_of

    return sections_of(models()[kind])


def matching(sections: list[KeySection], word: str) -> list[KeySection]:
    """The sections whose path contains a word, whole, and the matching keys of the others."""
    kept_sections = []
    for section in sections:
        kept = (
            section.keys if word in section.path else tuple(key for key in section.keys if word in key.name)
        )
        if kept:
            kept_sections.append(dataclasses.replace(section, keys=kept))
    return kept_sections


def _content(section: KeySection) -> dict[str, object]:
    return {
        "section": section.path,
        "repeated": section.repeated,
        "meaning": section.meaning,
        "left_out": section.left_out,
        "keys": [dataclasses.asdict(key) for key in section.keys],
    }


def _words(section: KeySection) -> str:
    lines = [f"{section.title} {section.left_out}".rstrip(), f"  {section.meaning}"]
    for key in section.keys:
        lines += [f"  {key.name}: {summary(key)}", f"      {key.meaning}", f"      {key.example}"]
    return "\n".join(lines) + "\n"


def summary(key: Key) -> str:
    """Type, unit, range and default of a key in one line."""
    unit = f" ({key.unit})" if key.unit and key.unit != "1" else ""
    span = f", {key.range}" if key.range not in {"", "any", "finite"} else ""
    default = key.default if key.default == "required" else f"default {key.default}"
    return f"{key.type}{unit}{span}; {default}"
