"""Columns of CSV and Parquet files as arrays: missing columns and unreadable numbers named, empty rows counted."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.errors import DataError
from bottomlock.io.columns import NS_OF, column_numbers, named_column, numbers_of_text, read_rows
from bottomlock.replay.clock import ClockReport, Fault, Timed, row_times
from bottomlock.replay.stream_sections import Clock, Stream


def column_stamps(table: pl.DataFrame, clock: Clock, *, place: str) -> NDArray[np.int64] | None:
    """(n,) integer nanoseconds of the clock's column, without its offset; None where it names none.

    Raises:
        DataError: for a column that is not there, and a row without a time.
    """
    if clock.column is None:
        return None
    series = named_column(table, clock.column, place)
    if clock.unit == "ns":
        if series.dtype == pl.String:
            series = numbers_of_text(series, clock.column, place, pl.Int64())
        missing = series.is_null().arg_true()
        if not len(missing) and series.dtype.is_integer():
            return np.array(series.cast(pl.Int64()).to_numpy(), dtype=np.int64)
    stamps = column_numbers(table, clock.column, place)
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
    table = read_rows(stream.file)
    timed = row_times(
        column_stamps(table, stream.clock, place=place), table.height, stream.clock, place=place
    )
    values = np.stack([column_numbers(table, name, place) for name in names], axis=1)
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
