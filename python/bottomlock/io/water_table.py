"""The water table: cells of water profiles and water layers of any DVL in one form, beside the beam table.

A row for each ping and cell; signs follow the beams of the bottom: a beam reads positive when the vehicle moves along
it through the water.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np

from bottomlock.errors import DataError
from bottomlock.files.table_file import read_parquet
from bottomlock.io.account import Flags, Floats, Integers
from bottomlock.io.columns import WATER_ENDING, check_converted
from bottomlock.io.table_columns import TableColumns
from bottomlock.support.later import pl


def water_file(path: str | Path) -> Path:
    """Path of the water of a beam table.

    >>> water_file("dive/beams.parquet").as_posix()
    'dive/beams_water.parquet'
    """
    path = Path(path)
    return path.with_name(f"{path.stem}{WATER_ENDING}.parquet")


@dataclass(frozen=True, eq=False)
class WaterTable:
    """Cells of pings, sorted by time and cell; NaN marks what a record does not contain.

    Attributes:
        time_ns: (n,) int64, the time of the ping.
        cell: (n,) int64, from 1, the nearest, on.
        range_m: (n,) along the beam from the transducer to the middle of the cell.
        velocity_mps: (n, beams) of the vehicle through the water.
        valid: (n, beams).
        quality: (n, beams) correlation, 0 to 255.
        sd_mps: (n, beams) 1 sigma.
    """

    time_ns: Integers
    cell: Integers
    range_m: Floats
    velocity_mps: Floats
    valid: Flags
    quality: Floats
    sd_mps: Floats

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.time_ns)

    @property
    def beams(self) -> int:
        """Number of beams."""
        return int(self.velocity_mps.shape[1])

    def to_frame(self) -> pl.DataFrame:
        """The documented columns: null where a record holds nothing."""
        columns: dict[str, Any] = {"time_ns": self.time_ns, "cell": self.cell, "range_m": self.range_m}
        for k in range(self.beams):
            columns[f"beam{k + 1}_mps"] = self.velocity_mps[:, k]
            columns[f"beam{k + 1}_valid"] = self.valid[:, k]
            columns[f"beam{k + 1}_quality"] = self.quality[:, k]
            columns[f"beam{k + 1}_sd_mps"] = self.sd_mps[:, k]
        return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None))

    @classmethod
    def from_frame(cls, frame: pl.DataFrame, place: str) -> Self:
        """The table from its columns, as `to_frame` writes them.

        Raises:
            DataError: naming the place and the column: for one that is missing or of another type, rows that are not
                sorted by time and cell, a cell below 1, or a valid beam without a finite velocity and range.
        """
        columns = TableColumns(
            frame, place, "expected the columns of a water table (docs/howto/water_track.md)"
        )
        beams = columns.beams
        table = cls(
            time_ns=columns.integers("time_ns", "is empty"),
            cell=columns.integers("cell", "is empty"),
            range_m=columns.floats("range_m"),
            velocity_mps=columns.per_beam("mps", beams),
            valid=columns.flags_per_beam("valid", beams),
            quality=columns.per_beam("quality", beams),
            sd_mps=columns.per_beam("sd_mps", beams),
        )
        table._check(place)
        return table

    def _check(self, place: str) -> None:
        step_ns, cells = np.diff(self.time_ns), np.diff(self.cell)
        unsorted = np.flatnonzero((step_ns < 0) | ((step_ns == 0) & (cells <= 0)))
        if unsorted.size:
            raise DataError(
                f"row {unsorted[0] + 1} is not later, or of a later cell, than the one before", place=place
            )
        low = np.flatnonzero(self.cell < 1)
        if low.size:
            raise DataError(
                f"is {self.cell[low[0]]}",
                place=f"{place}: row {low[0]}",
                key="column 'cell'",
                expected="1 or more",
            )
        wrong = np.argwhere(self.valid & ~(np.isfinite(self.velocity_mps) & (self.range_m >= 0.0)[:, None]))
        if wrong.size:
            row, beam = (int(index) for index in wrong[0])
            raise DataError(
                f"beam {beam + 1} is flagged valid",
                place=f"{place}: row {row}",
                expected="a finite velocity and a range of 0 m or more, or a cleared flag",
            )


def joined(tables: Sequence[WaterTable]) -> WaterTable:
    """One table of some with as many beams, at least one, sorted by time and cell; of repeats the first stands."""
    if len(tables) == 1:
        return tables[0]
    parts = {
        one.name: np.concatenate([getattr(table, one.name) for table in tables]) for one in fields(WaterTable)
    }
    _, first = np.unique(np.stack([parts["time_ns"], parts["cell"]]), axis=1, return_index=True)
    return WaterTable(**{name: values[first] for name, values in parts.items()})


def read_water_table(path: str | Path) -> WaterTable:
    """Reads a water table, Parquet with the columns of `WaterTable.to_frame`.

    Raises:
        DataError: naming file and column, as `WaterTable.from_frame`; also for a file that cannot be read.
    """
    place = Path(path)
    check_converted(place)
    return WaterTable.from_frame(read_parquet(place), str(place))
