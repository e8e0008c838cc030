"""TOML files that a user writes: scenarios, cases, vehicles, geometries, column maps; what others are; values."""

import json
import math
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from bottomlock.errors import ScenarioError

Kind = Literal["scenario", "replay case", "live configuration", "DVL geometry", "vehicle", "column map"]

_KINDS: dict[Kind, tuple[Callable[[dict[str, Any]], bool], str]] = {
    "scenario": (lambda one: "trajectory" in one, "`bottomlock run` and others with a SCENARIO take it"),
    "replay case": (
        lambda one: any(isinstance(one.get(key), dict) and "file" in one[key] for key in ("dvl", "imu")),
        "`bottomlock replay` and `bottomlock tune` take it",
    ),
    "live configuration": (lambda one: isinstance(one.get("source"), list), "`bottomlock live` takes it"),
    "DVL geometry": (
        lambda one: "configuration" in one,
        "--geometry takes it, and the key dvl.geometry of a scenario, case or live configuration",
    ),
    "vehicle": (lambda one: "rigid_body" in one, "the key trajectory.vehicle of a scenario takes it"),
    "column map": (
        lambda one: isinstance(one.get("velocity"), list),
        "`bottomlock convert --columns` takes it",
    ),
}
"""How each kind of file is recognised, and what takes it."""

_TABLE = "`bottomlock fix`, `audit` and `simulate-dvl` take a beam table"
_LOG = "`bottomlock convert` takes a DVL's log or a table of readings, `bottomlock replay --init` those of a dive"


def read_text(path: Path, kind: Kind | Literal["TOML file"] = "TOML file", hint: str = "") -> str:
    """The text of a file, without the byte order mark that editors on Windows put before it.

    Raises:
        ScenarioError: naming the file and what it is, if there is none, with the hint, or it cannot be read as UTF-8.
    """
    if path.is_dir():
        there = ", ".join(sorted(one.name for one in path.glob("*.toml")))
        expected = f"a {kind}{there and f' (there: {there})'}"
        raise ScenarioError("is a folder", place=path, expected=expected)
    if not path.exists():
        raise ScenarioError(f"no such {kind}", place=path, hint=hint)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"cannot be read ({error.strerror})", place=path) from error
    if content.startswith(b"PAR1"):
        raise ScenarioError("is a Parquet table", place=path, expected="a TOML file", hint=_TABLE)
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise ScenarioError("is text in UTF-16", place=path, expected="UTF-8: save it with that encoding")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        what = "is binary" if b"\0" in content else f"cannot be read as text in UTF-8 ({error})"
        raise ScenarioError(what, place=path, expected="a TOML file", hint=_LOG) from error


def parse_toml(text: str, *, place: str, kind: Kind | None = None) -> dict[str, Any]:
    """The tables of a TOML text; `place` names it in errors. Every TOML file of a user is read here.

    Raises:
        ScenarioError: for ill-formed TOML, with its line, a number of thousands of digits, brackets in brackets
            without end, and a file of another kind than `kind`, with what takes it.
    """
    try:
        content = tomllib.loads(text)
    except ValueError as error:
        first = text.lstrip().partition("\n")[0]
        is_log = first.startswith(("{", "$", ":")) or ("," in first and not set(first) & set("=#["))
        hint = f"; it looks like readings: {_LOG}" if is_log else ""
        raise ScenarioError(f"not valid TOML: {error}{hint}", place=place) from error
    except RecursionError as error:
        raise ScenarioError("not valid TOML: brackets are nested too deeply", place=place) from error
    found = kinds_of(content)
    if kind is not None and found and kind not in found:
        raise ScenarioError(f"is a {found[0]}", place=place, expected=f"a {kind}", hint=_KINDS[found[0]][1])
    return content


def kinds_of(content: dict[str, Any]) -> list[Kind]:
    """What the tables of a file may be; empty for what is like none."""
    return [kind for kind, (is_it, _) in _KINDS.items() if is_it(content)]


def toml_value(value: Any) -> str:  # noqa: ANN401 - a value of any key
    """The value as TOML writes it, numbers to nine digits, large ones to a millionth of their unit.

    >>> toml_value({"column": "t", "sd_m": (0.5, 1e-7), "on": True}), toml_value(-1699999987.8)
    ('{ column = "t", sd_m = [0.5, 1e-07], on = true }', '-1699999987.8')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, str | Path):
        return json.dumps(str(value), ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    return str(value)


def _number(value: float) -> str:
    if math.isinf(value) or math.isnan(value):
        return str(value)
    # An offset between clocks of different centuries keeps its microseconds.
    digits = max(9, len(str(int(abs(value)))) + 6) if abs(value) < 1e12 else 17
    short = f"{value:.{digits}g}"
    return short if any(mark in short for mark in ".e") else f"{short}.0"
