"""A text of TOML, a key a line: the cases and the instruments' files of the tests."""

import json
from typing import Any

Sections = dict[str, Any]
"""Keys of each table by its name with dots, "" for those above all tables; of a list of tables, a list."""


def toml(sections: Sections) -> str:
    """The text."""
    lines: list[str] = []
    for name, bodies in sections.items():
        for body in bodies if isinstance(bodies, list) else [bodies]:
            head = f"[[{name}]]" if isinstance(bodies, list) else f"[{name}]"
            lines += [""] if not name else [head]
            lines += [f"{key} = {_value(one)}" for key, one in body.items()]
    return "\n".join(lines) + "\n"


def _value(one: Any) -> str:  # noqa: ANN401 - what TOML holds
    match one:
        case dict():
            return "{ " + ", ".join(f"{key} = {_value(each)}" for key, each in one.items()) + " }"
        case list() | tuple():
            return f"[{', '.join(map(_value, one))}]"
        case bool() | str():
            return json.dumps(one)
    return repr(float(one) if hasattr(one, "dtype") else one)
