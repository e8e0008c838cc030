"""The text of a case: keys with their values, and beside each what it was guessed from or what is not known."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from bottomlock.config.toml_value import toml_value

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
