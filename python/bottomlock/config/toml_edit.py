"""Values of single keys in a user's TOML text; everything else, comments too, stays as it is."""

import re
from collections.abc import Mapping
from typing import Any

from bottomlock.config.toml_file import parse_toml
from bottomlock.config.toml_value import toml_value
from bottomlock.errors import ScenarioError

MARK = " | "
"""Between a remark and the user's own comment."""
_TABLE = re.compile(r"^\s*\[\s*([A-Za-z0-9_.\-]+)\s*\]\s*(#.*)?$")
_ARRAY = re.compile(r"^\s*\[\[")
_KEY = re.compile(r"^(\s*)([A-Za-z0-9_.\-]+)(\s*=\s*)(\{[^{}#]*\}|[^#\"'\[{]*?)(\s*)(#.*)?$")
"""A key with its value, a plain one or braces without braces in them, and a comment."""


def edited(text: str, values: Mapping[str, float], remarks: Mapping[str, str], *, place: str) -> str:
    """A TOML text with other values, each with a remark; a key that is not there is added to its table.

    Args:
        text: the text.
        values: numbers by their keys, with dots.
        remarks: a comment for each key; the one that is there already follows it, but for an earlier remark.
        place: names the text in errors.

    Raises:
        ScenarioError: for a key in another form than `key = value`, in its table or in braces on one line.
    """
    lines = text.splitlines()
    for key, value in values.items():
        lines = _with_key(lines, key, toml_value(value), remarks[key])
    result = "\n".join(lines) + "\n"
    _check(text, result, values, place)
    return result


def _with_key(lines: list[str], key: str, value: str, remark: str) -> list[str]:
    """The lines with a key's value and remark."""
    table, name = key.rpartition(".")[::2]
    current, end = "", None
    for row, line in enumerate(lines):
        if _ARRAY.match(line):
            current = "[]"
        elif match := _TABLE.match(line):
            current = match[1]
        elif match := _KEY.match(line):
            found, here = f"{current}.{match[2]}".lstrip("."), match[4]
            new = value if found == key else ""
            if found == table and here.startswith("{"):
                new = f"{{ {_in_braces(here[1:-1], name, value)} }}"
            if new:
                own = _own_comment(match[6], remark)
                return [
                    *lines[:row],
                    f"{match[1]}{match[2]}{match[3]}{new}  # {remark}{own}",
                    *lines[row + 1 :],
                ]
        if current == table and line.strip() and not line.lstrip().startswith("#"):
            end = row + 1
    new = f"{name} = {value}  # {remark}"
    if end is None:
        return [*lines, "", f"[{table}]", new]
    return [*lines[:end], new, *lines[end:]]


def _in_braces(inside: str, name: str, value: str) -> str:
    """What an inline table has in its braces, with a key's value."""
    parts = {part.partition("=")[0].strip(): part.strip() for part in inside.split(",") if part.strip()}
    return ", ".join((parts | {name: f"{name} = {value}"}).values())


def _own_comment(comment: str | None, remark: str) -> str:
    """What the user wrote beside a value, after the mark of a remark; nothing for a remark without it."""
    own = (comment or "").lstrip("# ").strip()
    if own.startswith(remark.split(":", maxsplit=1)[0] + ":"):
        own = own.partition(MARK)[2]
    return f"{MARK}{own}" if own else ""


def _check(text: str, result: str, values: Mapping[str, float], place: str) -> None:
    """Checks that the edited text has the new values, and nothing else changed."""
    wanted = parse_toml(text, place=place)
    for key, value in values.items():
        at: Any = wanted
        *tables, name = key.split(".")
        for table in tables:
            at = at.setdefault(table, {})
        # As the text has it, to as many digits.
        at[name] = float(toml_value(value))
    try:
        found = parse_toml(result, place=place)
    except ScenarioError:
        found = {}
    if found != wanted:
        keys = ", ".join(f"{key} = {toml_value(value)}" for key, value in values.items())
        raise ScenarioError(
            f"the new values could not be written into the text ({keys})",
            place=place,
            hint="write each key without quotes on a line of its own in its table",
        )
