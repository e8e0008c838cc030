"""The text of a case: keys with their values, and beside each what it was guessed from or what is not known."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field

WIDTH = 118


@dataclass
class Section:
    """A section of a case: its name, remarks above it, and lines."""

    name: str
    remarks: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    def put(self, key: str, value: object, why: str = "", *, known: bool = True) -> None:
        """Adds a key; `why` becomes "guessed: ..." or, where it is not known, a question."""
        self.lines.append(noted(f"{key} = {toml_value(value)}", why, known=known))

    def ask(self, words: str) -> None:
        """Adds a question as lines of their own."""
        self.lines += wrapped(f"? {words}")

    def say(self, words: str) -> None:
        """Adds a remark as lines of their own."""
        self.lines += wrapped(words)

    def text(self) -> str:
        """The section as TOML."""
        head = [line for words in self.remarks for line in wrapped(words)]
        title = [f"[{self.name}]"] if self.name else []
        return "\n".join([*head, *title, *self.lines]) + "\n"


def toml_value(value: object) -> str:
    """A value as TOML.

    >>> toml_value(True), toml_value("m/s2"), toml_value({"unit": "s", "offset_s": 0.5}), toml_value((1.0, 2.0))
    ('true', '"m/s2"', '{ unit = "s", offset_s = 0.5 }', '[1.0, 2.0]')
    >>> toml_value(-1699999987.8), toml_value(1e-7)
    ('-1699999987.8', '1e-07')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(one) for one in value) + "]"
    if isinstance(value, float):
        # Nine digits, and a microsecond of an offset between clocks of different centuries.
        digits = max(9, len(str(int(abs(value)))) + 6) if abs(value) < 1e12 else 17
        short = f"{value:.{digits}g}"
        return short if any(mark in short for mark in ".e") else f"{short}.0"
    return json.dumps(value, ensure_ascii=False)


def noted(line: str, why: str, *, known: bool = True) -> str:
    """A line with its reason, which goes above the line where it is too long to stand beside it."""
    if not why:
        return line
    words = f"guessed: {why}" if known else f"? {why}"
    if len(line) + len(words) + 4 <= WIDTH:
        return f"{line}  # {words}"
    return "\n".join([*wrapped(words), line])


def wrapped(words: str) -> list[str]:
    """Words as comment lines."""
    lines, line = [], "#"
    for word in words.split():
        if len(line) + len(word) + 1 > WIDTH:
            lines.append(line)
            line = "#  "
        line += f" {word}"
    return [*lines, line]


def joined(sections: Iterable[Section]) -> str:
    """The sections of a case, with a blank line between them."""
    return "\n".join(section.text() for section in sections)
