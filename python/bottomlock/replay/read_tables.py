"""Columns of CSV and Parquet files as arrays; errors name missing columns and cells, empty rows are counted."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock import units
from bottomlock.errors import DataError
from bottomlock.io.beam_table import read_water_table
from bottomlock.io.beams import Instrument, read_times
from bottomlock.io.columns import (
    LATEST_NS,
    NS_OF,
    column_numbers,
    named_column,
    number_series,
    numbers_of_text,
    read_rows,
)
from bottomlock.recordings.dvl_sections import DvlStream
from bottomlock.recordings.stream_sections import Clock, Stream
from bottomlock.recordings.streams import Floats, Times, WaterBeams
from bottomlock.recordings.water_cells import CellCounts, check_cells, water_beams
from bottomlock.replay.case import Case
from bottomlock.replay.clock import ClockReport, Fault, TimedRows, row_times


def read_water(
    case: Case, file: Path, instrument: Instrument, clocks: dict[str, ClockReport]
) -> tuple[WaterBeams, CellCounts]:
    """The beams of [water_track], one row a ping, and what became of their cells.

    Args:
        case: a case with the section.
        file: its water table.
        instrument: the DVL.
        clocks: takes up the report on its times.

    Raises:
        DataError: for a table that cannot be read, is empty, or does not fit the DVL or the chosen cells.
    """
    section, dvl = case.water_track, case.dvl
    assert section is not None
    table = read_water_table(file)
    if not table.rows:
        raise DataError("has no row", place=file, expected="cells of water", hint="leave [water_track] out")
    bottom = _bottom_ranges(dvl, instrument) if dvl.source == "beams" else None
    try:
        check_cells(table, section)
        beams, counts = water_beams(
            table, instrument.geometry, section, beam_sd_mps=instrument.beam_sd_mps, bottom=bottom
        )
    except DataError as error:
        raise DataError(error, place=file) from error
    clock = Clock(column="time_ns", unit="ns", offset_s=dvl.clock.offset_s)
    timed = row_times(beams.time_ns, len(beams.time_ns), clock, place=str(file))
    clocks["water_track"] = timed.report
    return replace(beams, time_ns=timed.time_ns + units.ns_from_s(instrument.stated.clock_offset_s)), counts


def _bottom_ranges(dvl: DvlStream, instrument: Instrument) -> tuple[Times, Floats] | None:
    """Times (m,) and ranges along the beams (m, B), m, of the pings of the bottom; None where the table has none."""
    place, rows = str(dvl.file), read_rows(dvl.file)
    columns = instrument.columns
    names = columns.range or tuple(f"beam{k + 1}_range_m" for k in range(instrument.geometry.beams))
    if any(name not in rows.columns or rows[name].null_count() == rows.height for name in names):
        return None
    return (
        read_times(rows, columns, place),
        np.stack([column_numbers(rows, name, place) for name in names], axis=1),
    )


def column_stamps(table: pl.DataFrame, clock: Clock, *, place: str) -> NDArray[np.int64] | None:
    """(n,) integer nanoseconds of the clock's column, without its offset; None where the clock names no column.

    Raises:
        DataError: for a missing column, and a row without a time.
    """
    if clock.column is None:
        return None
    series = named_column(table, clock.column, place)
    if clock.unit == "ns":
        if series.dtype == pl.String:
            series = numbers_of_text(series, clock.column, place, pl.Int64())
        missing = series.is_null().arg_true()
        if not len(missing) and series.dtype.is_integer():
            series = number_series(table.with_columns(series), clock.column, place, pl.Int64())
            return np.array(series.to_numpy(), dtype=np.int64)
    stamps = column_numbers(table, clock.column, place)
    absent = np.flatnonzero(~np.isfinite(stamps))
    if absent.size:
        raise DataError(
            "has no time",
            place=f"{place}: row {absent[0]}",
            key=f"column '{clock.column}'",
            expected="a number",
        )
    beyond = np.flatnonzero(np.abs(stamps) >= LATEST_NS / NS_OF[clock.unit])
    if beyond.size:
        raise DataError(
            f"is {stamps[beyond[0]]:g} {clock.unit}",
            place=f"{place}: row {beyond[0]}",
            key=f"column '{clock.column}'",
            expected="a time that 64 bits of nanoseconds can hold",
            hint="check the unit of the clock",
        )
    # Unix seconds in a float64 resolve 0.2 µs; whole seconds are split off so that the conversion loses no more.
    whole, part = np.divmod(stamps * NS_OF[clock.unit], 1e9)
    return np.asarray(whole.astype(np.int64) * 1_000_000_000 + np.round(part).astype(np.int64))


def read_stream(
    stream: Stream,
    names: Sequence[str],
    *,
    optional: bool = True,
    lost: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None,
) -> tuple[NDArray[np.float64], TimedRows, pl.DataFrame]:
    """Reads the named columns of a stream, (n, columns), in the rows where each of them holds a number.

    Args:
        stream: file, clock and decimation (`every`).
        names: names of the columns.
        optional: rows with an empty cell are left out and counted; if false they are an error.
        lost: rows (n,) of the values that hold codes for "no reading"; they count as empty.

    Returns:
        Values, their times, and the whole table, whose rows `TimedRows.rows` counts.

    Raises:
        DataError: for a file that cannot be read, rows out of order unless declared, and a stream without a complete
            row.
    """
    place = str(stream.file)
    table = read_rows(stream.file)
    timed = row_times(
        column_stamps(table, stream.clock, place=place), table.height, stream.clock, place=place
    )
    values = np.stack([column_numbers(table, name, place) for name in names], axis=1)
    if lost is not None:
        values[lost(values)] = np.nan
    whole = np.asarray(np.isfinite(values).all(axis=1))
    incomplete = timed.rows[~whole[timed.rows]]
    if incomplete.size and not optional:
        row = int(incomplete[0])
        name = names[int(np.flatnonzero(~np.isfinite(values[row]))[0])]
        raise DataError(
            "is empty", place=f"{place}: row {row}", key=f"column '{name}'", expected="a number in every row"
        )
    keep = np.flatnonzero(whole[timed.rows])[:: stream.every]
    if not keep.size:
        raise DataError(f"no row holds a number in each of {', '.join(names)}", place=place)
    rows = timed.rows[keep]
    kept = TimedRows(rows, timed.time_ns[keep], _report(timed, incomplete, keep))
    return np.ascontiguousarray(values[rows]), kept, table


def _report(timed: TimedRows, incomplete: NDArray[np.int64], keep: NDArray[np.int64]) -> ClockReport:
    empty = Fault()
    if incomplete.size:
        first = int(np.flatnonzero(timed.rows == incomplete[0])[0])
        empty = Fault(int(incomplete.size), int(incomplete[0]), float(timed.time_ns[first]) * 1e-9)
    return replace(timed.report, kept=len(keep), empty=empty)
