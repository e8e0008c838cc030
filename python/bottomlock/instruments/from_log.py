"""Readings of a recording: a beam table, a raw log of any known format, or a replay case with its IMU and depth."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from bottomlock.errors import DataError
from bottomlock.instruments.readings import Readings, ranges_or_flat
from bottomlock.io.beam_table import BeamTable, read_beam_table
from bottomlock.io.beams import read_geometry
from bottomlock.io.formats import read_recording
from bottomlock.io.water_table import WaterTable, read_water_table, water_file
from bottomlock.recordings.water_cells import same_ping
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams


def readings_of_log(path: Path, *, geometry: str | None, altitude_m: float = 20.0) -> Readings:
    """The pings of a beam table (Parquet of `bottomlock convert`) or of a raw log.

    Args:
        path: the file.
        geometry: packaged name or TOML file; None for the one that the log identifies.
        altitude_m: over the bottom, for beams without a recorded range.

    Raises:
        DataError: for a file that cannot be read, one without beams, or a geometry that is not known.
        ScenarioError: for a geometry that cannot be read.
    """
    known = geometry
    if path.suffix.lower() == ".parquet":
        table = read_beam_table(path)
        beside = water_file(path)
        water = read_water_table(beside) if beside.is_file() else None
    else:
        recording = read_recording(path)
        table, water, known = recording.table, recording.water, geometry or recording.geometry or None
    if known is None:
        raise DataError(
            "does not identify its instrument", place=path, hint="name its geometry with --geometry"
        )
    instrument = read_geometry(known)
    if not table.rows or table.beams != instrument.geometry.beams:
        raise DataError(
            f"{table.rows} pings of {table.beams} beams",
            place=path,
            expected=f"pings of {instrument.geometry.beams} beams as geometry {known} has",
        )
    beam_mps = np.where(table.valid, table.velocity_mps, np.nan)
    if water is not None and water.beams != table.beams:
        raise DataError(
            f"its water has {water.beams} beams", place=path, expected=f"{table.beams} as its pings"
        )
    readings = Readings(
        name=path.name,
        geometry=instrument.geometry,
        beam_sd_mps=instrument.beam_sd_mps,
        time_ns=table.time_ns,
        beam_mps=beam_mps,
        range_m=ranges_or_flat(table.range_m, beam_mps, instrument.geometry, altitude_m),
        stated=_stated(table),
    )
    return readings if water is None or not water.rows else _with_water(readings, water)


def _with_water(readings: Readings, water: WaterTable) -> Readings:
    """The nearest cell of the water at the pings that it was measured with: the records hold one."""
    nearest = np.flatnonzero(water.cell == water.cell.min())
    at, same = same_ping(readings.time_ns, water.time_ns[nearest])
    found = np.full(readings.beam_mps.shape, np.nan)
    rows = nearest[same]
    found[at[same]] = np.where(water.valid[rows], water.velocity_mps[rows], np.nan)
    sd = water.sd_mps[rows]
    known = np.isfinite(sd)
    return replace(
        readings,
        water_mps=found,
        water_range_m=float(np.median(water.range_m[nearest])),
        water_sd_mps=float(np.median(sd[known])) if known.any() else readings.water_sd_mps,
    )


def _stated(table: BeamTable) -> np.ndarray:
    return np.asarray(table.instrument_valid != 0)


def readings_of_case(path: Path, *, altitude_m: float = 20.0) -> Readings:
    """The pings, IMU and depth of a replay case, on its one clock and in platform axes.

    Raises:
        ScenarioError: for a case with a fault.
        DataError: for a file that cannot be read.
    """
    case = load_case(path)
    streams = read_streams(case)
    beams, geometry = streams.beams, streams.instrument.geometry
    beam_mps = np.where(beams.valid, beams.velocity_mps, np.nan)
    return Readings(
        name=case.name,
        geometry=geometry,
        beam_sd_mps=streams.instrument.beam_sd_mps,
        time_ns=beams.time_ns,
        beam_mps=beam_mps,
        range_m=ranges_or_flat(None, beam_mps, geometry, altitude_m),
        stated=np.ones(len(beams.time_ns), dtype=bool),
        imu=streams.inertial,
        depth=streams.depths,
    )
