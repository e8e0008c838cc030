"""Columns of CSV and Parquet files as arrays and readings in SI; errors name missing columns and cells."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import singledispatch
from pathlib import Path
from typing import Any

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
from bottomlock.recordings.axes import from_angles, platform_attitude
from bottomlock.recordings.drives import FASTEST_MPS, drag_beyond
from bottomlock.recordings.dvl_sections import DvlStream
from bottomlock.recordings.sensors import SENSORS
from bottomlock.recordings.stream_sections import (
    AttitudeStream,
    Clock,
    DepthStream,
    EffortStream,
    SensorStream,
    Stream,
    ThrustStream,
)
from bottomlock.recordings.streams import (
    Attitudes,
    Depths,
    Flags,
    Floats,
    Forces,
    Revolutions,
    Times,
    WaterBeams,
)
from bottomlock.recordings.water_cells import CellCounts, check_cells, water_beams
from bottomlock.replay.case import Case
from bottomlock.replay.clock import ClockReport, Fault, TimedRows, row_times
from bottomlock.units import STANDARD_GRAVITY_MPS2


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


FORCE_SI = {"m/s2": 1.0, "g": STANDARD_GRAVITY_MPS2, "mg": 1e-3 * STANDARD_GRAVITY_MPS2}
OMEGA_SI = {"rad/s": 1.0, "deg/s": np.pi / 180.0, "deg/h": np.pi / 648_000.0}
SPEED_SI = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0, "ft/s": 0.3048}
ANGLE_SI = {"rad": 1.0, "deg": np.pi / 180.0}
LENGTH_SI = {"m": 1.0, "cm": 1e-2, "ft": 0.3048}
REVOLUTIONS_SI = {"Hz": 1.0, "rpm": 1.0 / 60.0, "rad/s": 0.5 / np.pi}
PRESSURE_SI = {"Pa": 1.0, "kPa": 1e3, "mbar": 1e2, "bar": 1e5, "dbar": 1e4}

NEAR = 2.0
"""A unit is told by a slope within this factor."""


def rate_unit(scale: float, stated: str) -> tuple[str, float] | None:
    """The unit of gyros that turn `scale` times as far as an attitude, and the scale in it; None where none is near.

    Args:
        scale: in the unit in which they were read.
        stated: that unit.

    >>> rate_unit(57.0, "rad/s")[0], rate_unit(1.1, "deg/s")[0], rate_unit(7.0, "rad/s"), rate_unit(-1.0, "rad/s")
    ('deg/s', 'deg/s', None, None)
    """
    scales = {unit: scale * factor / OMEGA_SI[stated] for unit, factor in OMEGA_SI.items()}
    return next(((unit, of) for unit, of in scales.items() if 1.0 / NEAR < of < NEAR), None)


_REFUSED_MPS = 1e3
"""Speed through the water that the kernel refuses."""


@singledispatch
def stream_of(section: SensorStream, time_ns: Times, values: Floats) -> Any:  # noqa: ANN401 - a stream of the sensor's
    """The readings of a sensor in SI, of the columns (n, k) of its table.

    Without a function for its section the columns are the numbers of its reading, and stand in its fields.

    Raises:
        DataError: for values that cannot be.
    """
    sensor = next(one for one in SENSORS if isinstance(section, one.settings))
    ends = np.cumsum([of.count or 1 for of in sensor.numbers])
    parts = zip(sensor.numbers, np.split(values, ends[:-1], axis=1), strict=True)
    return sensor.reading(time_ns, *(part if of.count else part[:, 0] for of, part in parts))


@stream_of.register
def _(section: DepthStream, time_ns: Times, values: Floats) -> Depths:
    if section.unit in LENGTH_SI:
        metres = values[:, 0] * LENGTH_SI[section.unit]
    else:
        metres = (
            values[:, 0]
            * PRESSURE_SI[section.unit]
            / (section.water_density_kg_per_m3 * STANDARD_GRAVITY_MPS2)
        )
    return Depths(time_ns, (-metres if section.up else metres) + section.offset_m)


@stream_of.register
def _(section: ThrustStream, time_ns: Times, values: Floats) -> Revolutions:
    revolutions_hz = values[:, 0] * REVOLUTIONS_SI[section.unit]
    if not revolutions_hz.any():
        raise DataError(
            "is 0 in every row",
            place=section.file,
            key=f"column '{section.column}'",
            expected="revolutions",
            hint="leave [thrust] out",
        )
    speed_mps = section.advance_m * float(np.median(np.abs(revolutions_hz[revolutions_hz != 0.0])))
    if speed_mps > FASTEST_MPS:
        raise DataError(
            (
                f"column '{section.column}' in {section.unit} and thrust.advance_m = "
                f"{section.advance_m:g} m are {speed_mps:.3g} m/s in the median"
            ),
            place=section.file,
            expected=f"at most {FASTEST_MPS:g} m/s: check thrust.unit and thrust.advance_m",
        )
    beyond = np.abs(revolutions_hz) * section.advance_m >= _REFUSED_MPS
    if beyond.any():
        what = f"{section.unit}, {_REFUSED_MPS:g} m/s or more"
        raise _spike(section.file, section.column, what, values[:, 0], time_ns, beyond)
    return Revolutions(time_ns, revolutions_hz)


def _spike(place: Path, column: str, what: str, values: Floats, time_ns: Times, beyond: Flags) -> DataError:
    """The error of single readings that are none: a replay would stop at them, or be spoilt."""
    k = int(np.flatnonzero(beyond)[0])
    found = f"is {values[k]:.3g} {what}, at {time_ns[k] * 1e-9:.6f} s, the first of {int(beyond.sum())} such readings"
    hint = "empty the cell of a reading that is none: its row is then left out and counted"
    return DataError(found, place=place, key=f"column '{column}'", hint=hint)


@stream_of.register
def _(section: EffortStream, time_ns: Times, values: Floats) -> Forces:
    if not values.any():
        raise DataError(
            f"columns {', '.join(section.force)} are 0 in every row",
            place=section.file,
            expected="forces",
            hint="leave [effort] out",
        )
    force_n = np.median(np.abs(values), axis=0)
    for axis, (name, drag) in enumerate(zip(section.force, drag_beyond(section), strict=True)):
        if force_n[axis] > drag:
            raise DataError(
                f"is {force_n[axis]:.3g} N in the median, and at {FASTEST_MPS:g} m/s the drag is {drag:.3g} N",
                place=section.file,
                key=f"column '{name}'",
                hint="check the unit of the forces, and linear and quadratic drag",
            )
        beyond = np.abs(values[:, axis]) > drag
        if beyond.any():
            what = f"N, more than the drag at {FASTEST_MPS:g} m/s, {drag:.3g} N"
            raise _spike(section.file, name, what, values[:, axis], time_ns, beyond)
    return Forces(time_ns, values)


@stream_of.register
def _(section: AttitudeStream, time_ns: Times, values: Floats) -> Attitudes:
    sensor = from_angles(*(values * ANGLE_SI[section.unit]).T)
    offset = float(np.deg2rad(section.yaw_offset_deg))
    return Attitudes(time_ns, platform_attitude(sensor, section.frame, section.mounting_rpy_rad, offset))
