"""A first case as entries: each key with its value, why, and whether the files decide it; and its text."""

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from bottomlock.config.toml_file import toml_value
from bottomlock.files.overwriting import check_free

WIDTH = 118
FILES = "files"
"""Key of the remarks that say what the files hold."""
MARKS = {True: "guessed: ", False: "assumed: ", None: ""}
"""Beginnings of a reason: of what the files decide, of what they do not, and of a plain remark."""
QUESTIONS = {
    "where": "where was this? The latitude gives gravity and the Earth's rate",
    "heading": "which north has the heading, true or magnetic, and what gives it?",
    "instrument": "which instruments are these, and how are they mounted? `bottomlock list geometries`, `list grades`",
    "dive": "are these files of one dive, and by which clock?",
}
"""What the files may leave open, each with one answer; the last one only where their times have nothing in common."""


@dataclass(frozen=True, eq=False)
class Beside:
    """A file that is written beside the case: the value of an entry that names it.

    Attributes:
        name, suffix: after the name of the case.
        write: writes it to a path.
        further: paths that are written with it.
    """

    name: str
    write: Callable[[Path], object]
    suffix: str = ".parquet"
    further: tuple[Callable[[Path], Path], ...] = ()

    def path(self, case: Path) -> Path:
        """Where it goes."""
        return case.parent / f"{case.stem}_{self.name}{self.suffix}"


@dataclass(frozen=True, eq=False)
class Entry:
    """A key of a case; without a value a remark.

    Attributes:
        key: with its section, "dvl.geometry"; "dvl." for a remark on the section, "name" for what is in none.
        value: of the case; a path is written as the case names it.
        why: the reason; "" for what needs none.
        known: whether the evidence excludes other values; False for what is assumed, None where nothing is to decide.
        asks: the question that decides what is assumed, of `QUESTIONS`; "" for what its sigma or a replay covers.
    """

    key: str
    value: object = None
    why: str = ""
    known: bool | None = True
    asks: str = ""

    @property
    def section(self) -> str:
        """Its section; "" before the first."""
        return self.key.rpartition(".")[0]

    @property
    def setting(self) -> str:
        """Key and value as TOML; "" without a value."""
        return "" if self.value is None else f"{self.key.rpartition('.')[2]} = {toml_value(self.value)}"

    @property
    def words(self) -> str:
        """The reason with its mark; "" for none."""
        return f"{MARKS[self.known]}{self.why}" if self.why else ""

    def text(self) -> str:
        """Lines of TOML; a reason that is too long to stand beside the setting goes above it."""
        beside = f"{self.setting}  # {self.words}" if self.words else self.setting
        if self.setting and (not self.words or len(beside) <= WIDTH):
            return beside
        return "\n".join([*_wrapped(self.words), *([self.setting] if self.setting else [])])


def remark(section: str, words: str) -> Entry:
    """A comment in a section."""
    return Entry(f"{section}." if section else "", why=words, known=None)


def assumed(entries: Iterable[Entry]) -> list[Entry]:
    """What the files do not decide."""
    return [one for one in entries if one.known is False and one.why]


def questions(entries: Iterable[Entry]) -> list[str]:
    """A question for all keys that one answer decides."""
    open_keys = assumed(entries)
    return [
        f"{asks}: {words} ({', '.join(dict.fromkeys(one.key for one in open_keys if one.asks == asks))})"
        for asks, words in QUESTIONS.items()
        if any(one.asks == asks for one in open_keys)
    ]


def _wrapped(words: str) -> list[str]:
    """Words as comment lines."""
    lines, line = [], "#"
    for word in words.split():
        if len(line) + len(word) + 1 > WIDTH:
            lines.append(line)
            line = "#  "
        line += f" {word}"
    return [*lines, line]


def toml_of(entries: Iterable[Entry]) -> str:
    """The entries as TOML, a blank line between sections."""
    sections = []
    for name, of in groupby(entries, lambda one: one.section):
        title = [f"[{name}]"] if name else []
        sections.append("\n".join([*title, *(one.text() for one in of)]) + "\n")
    return "\n".join(sections)


def placed(
    entries: Iterable[Entry], case: Path, inputs: Sequence[Path] = (), *, force: bool = False
) -> tuple[list[Entry], dict[Path, Beside]]:
    """The entries with the names of their files as the case at a path has them, and the files to write.

    Raises:
        OutputError: where a file to write exists already without `force`, or is one of the inputs.
    """
    check_free(case, inputs=inputs, force=force)
    named, beside = [], {}
    for one in entries:
        path = one.value
        if isinstance(path, Beside):
            file, path = path, path.path(case)
            for to in (path, *(further(path) for further in file.further)):
                check_free(to, inputs=inputs, force=force)
            beside[path] = file
        if isinstance(path, Path):
            one = replace(one, value=Path(os.path.relpath(path, case.parent)).as_posix())  # noqa: PLW2901
        named.append(one)
    return named, beside
