"""The command `bottomlock schema`: JSON schemas of the files that a user writes."""

import json
import sys
from typing import Annotated, Any

from cyclopts import Parameter
from pydantic import BaseModel

from bottomlock.cli.keys import MODELS, Kind
from bottomlock.config.key_reference import section_models, section_paths
from bottomlock.config.meaning import meaning_of


def schema(
    kind: Annotated[
        Kind,
        Parameter(
            help="Which file: scenario, case, geometry, vehicle, hovering_vehicle, columns (column map) or live."
        ),
    ],
    /,
) -> None:
    """Print the JSON schema of a scenario, case, geometry, vehicle, column map or live file.

    Editors complete and check a TOML file by it, and show what each key means.
    """
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    text = json.dumps(dialect | _described(MODELS[kind]), indent=2, ensure_ascii=False)
    sys.stdout.write(f"{text}\n")


def _described(model: type[BaseModel]) -> dict[str, Any]:
    """The schema of a model, each key with its meaning."""
    content = model.model_json_schema()
    for _, section in section_paths(model):
        found = content if section is model else content.get("$defs", {}).get(section.__name__, {})
        for name, entry in found.get("properties", {}).items():
            # The definition of a section has its own words.
            if not section_models(section.model_fields[name].annotation):
                entry["description"] = meaning_of(section, name).text
    return content
