"""Columns of the tables of beams and of water, checked as they are read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bottomlock.errors import DataError, bad_column
from bottomlock.io.account import Flags, Floats, Integers
from bottomlock.support.later import pl


@dataclass(frozen=True, eq=False)
class TableColumns:
    """Columns of a data frame with checked types; null is NaN, and false for flags.

    Attributes:
        frame: the table.
        place: its name, for messages.
        remedy: what to do where a column is missing.
    """

    frame: pl.DataFrame
    place: str
    remedy: str

    @property
    def beams(self) -> int:
        """How many beams the columns are numbered to."""
        beams = 0
        while f"beam{beams + 1}_mps" in self.frame.columns:
            beams += 1
        return beams

    def series(self, name: str, dtype: pl.DataType) -> pl.Series:
        """A column of a type.

        Raises:
            DataError: for one that is missing or of another type.
        """
        if name not in self.frame.columns:
            raise bad_column(self.place, name, "is missing", hint=self.remedy)
        found = self.frame[name]
        if found.dtype not in {dtype, pl.Null()}:
            raise bad_column(self.place, name, f"is {found.dtype}", dtype)
        return found.cast(dtype)

    def integers(self, name: str, lacking: str) -> Integers:
        """(n,) integers; DataError in the words `lacking` for an empty one."""
        series = self.series(name, pl.Int64())
        if series.null_count():
            raise DataError(
                f"column '{name}' {lacking}", place=f"{self.place}: row {series.is_null().arg_max()}"
            )
        return np.asarray(series.to_numpy())

    def times(self, name: str) -> Integers:
        """(n,) times that are there and rise strictly; DataError for others."""
        time_ns = self.integers(name, "has no time")
        steps = np.flatnonzero(np.diff(time_ns) <= 0)
        if steps.size:
            row = int(steps[0]) + 1
            raise bad_column(self.place, name, f"is {time_ns[row]} ns and does not rise", row=row)
        return time_ns

    def floats(self, name: str) -> Floats:
        """(n,)."""
        return np.asarray(self.series(name, pl.Float64()).fill_null(np.nan).to_numpy())

    def flags(self, name: str) -> Flags:
        """(n,)."""
        series = self.series(name, pl.Boolean()).fill_null(value=False)
        return np.asarray(series.to_numpy().astype(bool))

    def per_beam(self, quantity: str, beams: int) -> Floats:
        """(n, beams)."""
        parts = [self.floats(f"beam{k + 1}_{quantity}") for k in range(beams)]
        return np.stack(parts, axis=1) if parts else np.empty((self.frame.height, 0))

    def flags_per_beam(self, quantity: str, beams: int) -> Flags:
        """(n, beams)."""
        parts = [self.flags(f"beam{k + 1}_{quantity}") for k in range(beams)]
        return np.stack(parts, axis=1) if parts else np.empty((self.frame.height, 0), dtype=bool)
