"""A first case as entries: each key with its value, why, and whether the files decide it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import groupby

from bottomlock.config.toml_value import toml_value

WIDTH = 118
MARKS = {True: "guessed: ", False: "? ", None: ""}
"""Beginnings of a reason: of what the files decide, of a question, and of a plain remark."""


@dataclass(frozen=True)
class Entry:
    """A key of a section, or without a key a remark or a question.

    Attributes:
        section: its name; "" before the first.
        key, value: of the case.
        why: the reason, or the remark or question; "" for what needs none.
        known: whether the files decide it; False for a question, None for a plain remark.
    """

    section: str
    key: str = ""
    value: object = None
    why: str = ""
    known: bool | None = None

    @property
    def setting(self) -> str:
        """Key and value as TOML; "" without a key."""
        return f"{self.key} = {toml_value(self.value)}" if self.key else ""

    @property
    def words(self) -> str:
        """The reason with its mark; "" for none."""
        return f"{MARKS[self.known]}{self.why}" if self.why else ""

    def text(self) -> str:
        """Lines of TOML; a reason that is too long to stand beside the setting goes above it."""
        beside = f"{self.setting}  # {self.words}" if self.words else self.setting
        if self.setting and len(beside) <= WIDTH:
            return beside
        return "\n".join([*_wrapped(self.words), *([self.setting] if self.setting else [])])


def _wrapped(words: str) -> list[str]:
    """Words as comment lines."""
    lines, line = [], "#"
    for word in words.split():
        if len(line) + len(word) + 1 > WIDTH:
            lines.append(line)
            line = "#  "
        line += f" {word}"
    return [*lines, line]


@dataclass
class Section:
    """The entries of a section."""

    name: str
    entries: list[Entry] = field(default_factory=list)

    def put(self, key: str, value: object, why: str = "", *, known: bool | None = True) -> None:
        """Adds a key, see `Entry`."""
        self.entries.append(Entry(self.name, key, value, why, known))

    def ask(self, words: str) -> None:
        """Adds a question; none for no words."""
        if words:
            self.entries.append(Entry(self.name, why=words, known=False))

    def say(self, words: str) -> None:
        """Adds a remark."""
        self.entries.append(Entry(self.name, why=words))


def toml_of(entries: Iterable[Entry]) -> str:
    """The entries as TOML, a blank line between sections."""
    sections = []
    for name, of in groupby(entries, lambda one: one.section):
        title = [f"[{name}]"] if name else []
        sections.append("\n".join([*title, *(one.text() for one in of)]) + "\n")
    return "\n".join(sections)
