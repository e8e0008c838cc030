"""Values of single keys in a user's TOML text; everything else, comments too, stays as it is."""

from collections.abc import Mapping
from typing import Any

import tomlkit
from tomlkit.items import InlineTable

from bottomlock.config.toml_file import parse_toml
from bottomlock.config.toml_value import toml_value

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
        ScenarioError: for ill-formed TOML.
    """
    parse_toml(text, place=place)
    document = tomlkit.parse(text)
    for key, value in values.items():
        *tables, name = key.split(".")
        table: Any = document
        braces: list[InlineTable] = []
        for part in tables:
            table = table.setdefault(part, tomlkit.inline_table() if braces else tomlkit.table())
            braces += [table] if isinstance(table, InlineTable) else []
        # The remark of a key in braces stands behind the outermost ones.
        noted = braces[0] if braces else table.get(name)
        own = _own_comment("" if noted is None else noted.trivia.comment, remarks[key])
        table[name] = tomlkit.value(toml_value(value))
        noted = braces[0] if braces else table[name]
        noted.comment(remarks[key] + own)
        noted.trivia.comment_ws = "  "
    return tomlkit.dumps(document)


def _own_comment(comment: str, remark: str) -> str:
    """What the user wrote beside a value, after the mark of a remark; nothing for a remark without it."""
    own = comment.lstrip("# ").strip()
    if own.startswith(remark.split(":", maxsplit=1)[0] + ":"):
        own = own.partition(MARK)[2]
    return f"{MARK}{own}" if own else ""
