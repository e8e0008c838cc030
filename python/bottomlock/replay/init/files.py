"""The tables of a first case: the user's own where a replay can read them, else written again beside the case."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.config.toml_value import toml_value
from bottomlock.files.atomic_write import write_parquet, write_text
from bottomlock.files.overwriting import check_free
from bottomlock.io.beam_table import Recording, sidecar, water_file, write_recording
from bottomlock.recordings.streams import Integers
from bottomlock.replay.init.found import Found, Times

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


@dataclass(eq=False)
class Files:
    """Where a case and its tables go.

    Attributes:
        case: the case.
        force: whether files are overwritten.
        inputs: the recorded files, which never are.
        written: what was written beside it.
    """

    case: Path
    force: bool = False
    inputs: Sequence[Path] = ()
    written: list[Path] = field(default_factory=list)

    def relative(self, path: Path) -> str:
        """A path as the case names it."""
        return Path(os.path.relpath(path, self.case.parent)).as_posix()

    def beside(self, name: str, suffix: str = ".parquet") -> Path:
        """A new file beside the case.

        Raises:
            OutputError: where it exists already.
        """
        path = self.case.parent / f"{self.case.stem}_{name}{suffix}"
        self.check(path)
        return path

    def check(self, path: Path) -> None:
        """Checks that a file may be written.

        Raises:
            OutputError: where it exists already without `force`, or is one of the recorded files.
        """
        check_free(path, inputs=self.inputs, force=self.force)

    def recording(self, recording: Recording, source: Path) -> str:
        """Writes a beam table and its account."""
        path = self.beside("beams")
        self.check(sidecar(path))
        self.check(water_file(path))
        write_recording(recording, path, source=source)
        self.written.append(path)
        return self.relative(path)

    def geometry(self, text: str) -> str:
        """Writes a geometry file."""
        path = self.beside("dvl", ".toml")
        write_text(path, text)
        self.written.append(path)
        return self.relative(path)

    def table(
        self, found: Found, name: str, columns: dict[str, Any] | None = None
    ) -> tuple[str, dict[str, Any], dict[str, str]]:
        """File, clock and column names of a stream; `columns` (role to values) forces it to be written again."""
        times = found.times
        roles = {**found.columns, **found.extra}
        clock: dict[str, Any] = {"column": times.column, "unit": times.unit}
        if times.time_ns is None:
            clock = {}
        if found.table.plain and columns is None and (times.column or times.time_ns is None):
            clock |= _even(times) or _unordered(times.time_ns)
            return self.relative(found.table.path), clock, roles
        content: dict[str, Any] = {} if times.time_ns is None else {"time_ns": times.time_ns}
        if columns is None:
            own = {role: column for role, column in roles.items() if role != "increments"}
            values = {role: found.values(role)[:, 0] for role in own}
            content |= {column: values[role] for role, column in own.items()}
            names = roles
        else:
            content |= columns
            names = {role: role for role in columns}
        path = self.beside(name)
        write_parquet(path, pl.DataFrame(content).with_columns(pl.col(pl.Float64).fill_nan(None)))
        self.written.append(path)
        if times.time_ns is not None:
            # Times that were evened are written as they are used.
            clock = {"column": "time_ns", "unit": "ns"} | _unordered(times.time_ns)
        return self.relative(path), clock, names


def _even(times: Times) -> dict[str, float]:
    """The clock's keys for rows at an even rate, whose stamps are only where it begins."""
    return {} if times.rate_hz is None else {"rate_hz": times.rate_hz, "steady_within_s": times.within_s}


def _unordered(time_ns: Integers | None) -> dict[str, str]:
    """The clock's key for rows that repeat a time or go back."""
    if time_ns is None or (np.diff(time_ns) > 0).all():
        return {}
    return {"unordered": "drop"}
