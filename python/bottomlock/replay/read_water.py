"""Beams that the water returned: the table of a case read, screened with the ranges to the bottom, on one clock."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from bottomlock import units
from bottomlock.errors import DataError
from bottomlock.io.beams import Instrument, read_times
from bottomlock.io.columns import column_numbers, read_rows
from bottomlock.io.water_table import read_water_table
from bottomlock.recordings.streams import Floats, Times, WaterBeams
from bottomlock.recordings.water_cells import CellCounts, check_cells, water_beams
from bottomlock.replay.case import Case
from bottomlock.replay.clock import ClockReport, row_times
from bottomlock.replay.dvl_sections import DvlStream
from bottomlock.replay.stream_sections import Clock


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
