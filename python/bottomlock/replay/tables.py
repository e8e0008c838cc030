"""Columns of CSV and Parquet files as arrays: missing columns and unreadable numbers named, empty rows counted."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.replay.clock import NS_OF, ClockReport, Fault, Timed, row_times
from bottomlock.replay.stream_sections import Clock, Stream

SHOWN = 12
"""Columns that an error lists."""


def read_table(path: Path) -> pl.DataFrame:
    """A table; CSV as text, so that a number that cannot be read is told with its row.

    Raises:
        DataError: for a file that is not there, cannot be read, or has no rows.
    """
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    try:
        if path.suffix.lower() in {".parquet", ".pq"}:
            table = pl.read_parquet(path)
        else:
            table = pl.read_csv(path, infer_schema=False)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise DataError(f"{path}: cannot be read ({str(error).splitlines()[0]})") from error
    if not table.height:
        raise DataError(f"{path}: has no rows")
    return table


def column_numbers(table: pl.DataFrame, name: str, *, place: str) -> NDArray[np.float64]:
    """(n,) numbers of a column, NaN where a cell is empty.

    Raises:
        DataError: for a column that is not there or a cell that is no number.
    """
    series = _column(table, name, place)
    if series.dtype == pl.String:
        series = _numbers_of_text(series, name, place, pl.Float64())
    elif not series.dtype.is_numeric() and series.dtype != pl.Boolean:
        raise DataError(f"{place}: column '{name}' is {series.dtype}, expected numbers")
    return np.array(series.cast(pl.Float64()).fill_null(np.nan).to_numpy(), dtype=np.float64)


def _column(table: pl.DataFrame, name: str, place: str) -> pl.Series:
    if name not in table.columns:
        known = ", ".join(table.columns[:SHOWN]) + (", ..." if len(table.columns) > SHOWN else "")
        raise DataError(f"{place}: column '{name}' is missing (there are {known})")
    return table[name]


def _numbers_of_text(series: pl.Series, name: str, place: str, dtype: pl.DataType) -> pl.Series:
    text = series.str.strip_chars()
    empty = text.is_null() | (text == "") | (text.str.to_lowercase() == "nan")
    numbers = text.cast(dtype, strict=False)
    bad = (numbers.is_null() & ~empty).arg_true()
    if len(bad):
        raise DataError(f"{place}: row {bad[0]}, column '{name}' is '{text[int(bad[0])]}', expected a number")
    return numbers


def column_stamps(table: pl.DataFrame, clock: Clock, *, place: str) -> NDArray[np.int64] | None:
    """(n,) integer nanoseconds of the clock's column, without its offset; None where it names none.

    Raises:
        DataError: for a column that is not there, and a row without a time.
    """
    if clock.column is None:
        return None
    series = _column(table, clock.column, place)
    if clock.unit == "ns":
        if series.dtype == pl.String:
            series = _numbers_of_text(series, clock.column, place, pl.Int64())
        missing = series.is_null().arg_true()
        if not len(missing) and series.dtype.is_integer():
            return np.array(series.cast(pl.Int64()).to_numpy(), dtype=np.int64)
    stamps = column_numbers(table, clock.column, place=place)
    absent = np.flatnonzero(~np.isfinite(stamps))
    if absent.size:
        raise DataError(f"{place}: row {absent[0]}, column '{clock.column}' has no time")
    # Seconds of an epoch fill a float64 to 0.2 µs; whole seconds are split off so that no more is lost.
    whole, part = np.divmod(stamps * NS_OF[clock.unit], 1e9)
    return np.asarray(whole.astype(np.int64) * 1_000_000_000 + np.round(part).astype(np.int64))


def read_stream(
    stream: Stream, names: Sequence[str], *, optional: bool = True
) -> tuple[NDArray[np.float64], Timed, pl.DataFrame]:
    """The named columns of a stream, (n, columns), where every one of them holds a number, with their times.

    Args:
        stream: file, clock and thinning.
        names: of the columns.
        optional: rows with an empty cell are left out and counted; else they are refused.

    Returns:
        Values, times and the whole table, whose rows `Timed.rows` counts.

    Raises:
        DataError: for what cannot be read, rows out of order that are not declared, and a stream without a whole row.
    """
    place = str(stream.file)
    table = read_table(stream.file)
    timed = row_times(
        column_stamps(table, stream.clock, place=place), table.height, stream.clock, place=place
    )
    values = np.stack([column_numbers(table, name, place=place) for name in names], axis=1)
    whole = np.asarray(np.isfinite(values).all(axis=1))
    hollow = timed.rows[~whole[timed.rows]]
    if hollow.size and not optional:
        row = int(hollow[0])
        name = names[int(np.flatnonzero(~np.isfinite(values[row]))[0])]
        raise DataError(f"{place}: row {row}, column '{name}' holds no number")
    keep = np.flatnonzero(whole[timed.rows])[:: stream.every]
    if not keep.size:
        raise DataError(f"{place}: no row holds a number in {', '.join(names)}")
    rows = timed.rows[keep]
    kept = Timed(rows, timed.time_ns[keep], _told(timed, hollow, keep))
    return np.ascontiguousarray(values[rows]), kept, table


def _told(timed: Timed, hollow: NDArray[np.int64], keep: NDArray[np.int64]) -> ClockReport:
    empty = Fault()
    if hollow.size:
        first = int(np.flatnonzero(timed.rows == hollow[0])[0])
        empty = Fault(int(hollow.size), int(hollow[0]), float(timed.time_ns[first]) * 1e-9)
    return replace(timed.report, kept=len(keep), empty=empty)
