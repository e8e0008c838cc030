"""TOML files that a user writes: scenarios, cases, vehicles, geometries, column maps."""

import tomllib
from pathlib import Path
from typing import Any

from bottomlock.errors import ScenarioError


def read_text(path: Path) -> str:
    """The text of a file, without the byte order mark that editors on Windows put before it.

    Raises:
        ScenarioError: naming the file, if it cannot be read as UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read as text ({error})") from error


def parse_toml(text: str, *, place: str) -> dict[str, Any]:
    """The tables of a TOML text; `place` names it in errors. Every TOML file of a user is read here.

    Raises:
        ScenarioError: for ill-formed TOML, with its line, a number of thousands of digits, and brackets in brackets
            without end.
    """
    try:
        return tomllib.loads(text)
    except ValueError as error:
        raise ScenarioError(f"{place}: not valid TOML: {error}") from error
    except RecursionError as error:
        raise ScenarioError(f"{place}: not valid TOML: brackets are nested too deeply") from error
