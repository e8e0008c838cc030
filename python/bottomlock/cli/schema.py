"""The command `bottomlock schema`: JSON schemas of the files that a user writes."""

import json
import sys
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from bottomlock.config.scenario import Scenario
from bottomlock.io.beams import InstrumentFile
from bottomlock.replay.case import Case

Kind = Literal["scenario", "case", "geometry"]
MODELS: dict[Kind, Any] = {"scenario": Scenario, "case": Case, "geometry": InstrumentFile}


def schema(kind: Annotated[Kind, Parameter(help="Which file: scenario, case or geometry.")], /) -> None:
    """Print the JSON schema of a scenario, a replay case or a DVL geometry.

    Editors complete and check a TOML file by it.
    """
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    text = json.dumps(dialect | MODELS[kind].model_json_schema(), indent=2, ensure_ascii=False)
    sys.stdout.write(f"{text}\n")
