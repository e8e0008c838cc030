"""The tables of a first case: the user's own where a replay can read them, else written again beside the case."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.files.atomic_write import write_parquet, write_text
from bottomlock.files.overwriting import check_free
from bottomlock.io.beam_table import Recording, sidecar, water_file, write_recording
from bottomlock.recordings.streams import Integers
from bottomlock.replay.init.found import Found, Times


@dataclass(eq=False)
class Files:
    """Where a case and its tables go.

    Attributes:
        case: the case.
        force: whether files are overwritten.
        inputs: the recorded files, which never are.
        planned: what goes beside it, and how each is written.
    """

    case: Path
    force: bool = False
    inputs: Sequence[Path] = ()
    planned: dict[Path, Callable[[], object]] = field(default_factory=dict)

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

    def write(self) -> list[Path]:
        """Writes what is planned, and returns where.

        Raises:
            OutputError: where the directory cannot be written.
        """
        for write in self.planned.values():
            write()
        return list(self.planned)

    def _plan(self, path: Path, write: Callable[[], object]) -> str:
        self.planned[path] = write
        return self.relative(path)

    def recording(self, recording: Recording, source: Path) -> str:
        """A beam table and its account."""
        path = self.beside("beams")
        self.check(sidecar(path))
        self.check(water_file(path))
        return self._plan(path, lambda: write_recording(recording, path, source=source))

    def geometry(self, text: str) -> str:
        """A geometry file."""
        path = self.beside("dvl", ".toml")
        return self._plan(path, lambda: write_text(path, text))

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
        frame = pl.DataFrame(content).with_columns(pl.col(pl.Float64).fill_nan(None))
        if times.time_ns is not None:
            # Times that were evened are written as they are used.
            clock = {"column": "time_ns", "unit": "ns"} | _unordered(times.time_ns)
        return self._plan(path, lambda: write_parquet(path, frame)), clock, names


def _even(times: Times) -> dict[str, float]:
    """The clock's keys for rows at an even rate, whose stamps are only where it begins."""
    return {} if times.rate_hz is None else {"rate_hz": times.rate_hz, "steady_within_s": times.within_s}


def _unordered(time_ns: Integers | None) -> dict[str, str]:
    """The clock's key for rows that repeat a time or go back."""
    if time_ns is None or (np.diff(time_ns) > 0).all():
        return {}
    return {"unordered": "drop"}
