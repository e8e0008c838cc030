"""Values of single keys in a user's TOML text; everything else, comments too, stays as it is."""

from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.items import InlineTable, Table

from bottomlock.config.toml_file import parse_toml, toml_value
from bottomlock.errors import ScenarioError

MARK = " | "
"""Between a remark and the user's own comment."""


def edited(text: str, values: Mapping[str, float], remarks: Mapping[str, str], *, place: str) -> str:
    """A TOML text with other values, each with a remark; a key that is not there is added to its table.

    Args:
        text: the text.
        values: numbers by their keys, with dots.
        remarks: a comment for each key; the one that is there already follows it, but for an earlier remark.
        place: names the text in errors.

    Raises:
        ScenarioError: for ill-formed TOML, and where a table of a key is none.
    """
    wanted = parse_toml(text, place=place)
    for key, value in values.items():
        *tables, name = key.split(".")
        inner = wanted
        for part in tables:
            inner = inner.setdefault(part, {})
            if not isinstance(inner, dict):
                raise ScenarioError("is no table", place=place, key=part, expected=f"a table with '{key}'")
        inner[name] = float(value)
    # A table of its own would swallow the keys with dots that follow it.
    for new_table in (tomlkit.table, tomlkit.inline_table):
        found = _edited(text, values, remarks, new_table)
        if parse_toml(found, place=place) == wanted:
            return found
    raise ScenarioError(
        f"cannot be edited without a change of other keys: {', '.join(values)}",
        place=place,
        hint="give each table a line of its own, as in [imu]",
    )


def _edited(text: str, values: Mapping[str, float], remarks: Mapping[str, str], new_table: Any) -> str:  # noqa: ANN401
    """The text, with tables that are not there as `new_table` makes them."""
    document = tomlkit.parse(text)
    for key, value in values.items():
        *tables, name = key.split(".")
        table: Any = document
        braces: list[InlineTable] = []
        for part in tables:
            table = table.setdefault(part, tomlkit.inline_table() if braces else new_table())
            braces += [table] if isinstance(table, InlineTable) else []
        # The remark of a key in braces stands behind the outermost ones.
        noted = braces[0] if braces else table.get(name)
        own = _own_comment("" if noted is None else noted.trivia.comment, remarks[key])
        _put(table, name, tomlkit.value(toml_value(value)))
        noted = braces[0] if braces else table[name]
        noted.comment(remarks[key] + own)
        noted.trivia.comment_ws = "  "
    return tomlkit.dumps(document)


def _put(table: Any, name: str, value: Any) -> None:  # noqa: ANN401 - tomlkit's containers have no common class
    """Sets a key; a new one stands behind the last, before the empty lines and comments that lead to the next table."""
    body = table.value.body if isinstance(table, Table) and name not in table else []
    last = max((k for k, (key, _) in enumerate(body) if key is not None), default=-1)
    between = body[last + 1 :]
    del body[last + 1 :]
    table[name] = value
    body.extend(between)


def _own_comment(comment: str, remark: str) -> str:
    """What the user wrote beside a value, after the mark of a remark; nothing for a remark without it."""
    own = comment.lstrip("# ").strip()
    if own.startswith(remark.split(":", maxsplit=1)[0] + ":"):
        own = own.partition(MARK)[2]
    return f"{MARK}{own}" if own else ""
