"""Readings of a simulated run, a beam table, a raw log of any known format, or a replay case."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl

from bottomlock.config.beam_layout import BeamLayout
from bottomlock.config.scenario import Scenario
from bottomlock.config.scenario_sections import Dvl
from bottomlock.config.validation import checked
from bottomlock.errors import DataError
from bottomlock.instruments.readings import Floats, Readings, TrueStates, ranges_or_flat
from bottomlock.io.beam_table import WaterTable, read_beam_table, read_water_table, water_file
from bottomlock.io.beams import read_geometry, read_instrument_file
from bottomlock.io.columns import numbers_of
from bottomlock.io.formats import read_recording
from bottomlock.plant.flight import euler_rad
from bottomlock.recordings.streams import Depths, Inertial
from bottomlock.recordings.water_cells import same_ping
from bottomlock.replay.case import load_case
from bottomlock.replay.reading import read_streams
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from bottomlock.truth import Truth


def with_geometry(scenario: Scenario, geometry: str) -> Scenario:
    """The scenario with the beams of another DVL; its errors and its rules of loss stay.

    Raises:
        ScenarioError: for a geometry that cannot be read, or rules that name beams that it does not have.
    """
    other = read_instrument_file(geometry)
    kept = {
        k: v
        for k, v in scenario.dvl.model_dump(exclude_unset=True).items()
        if k not in BeamLayout.model_fields
    }
    beams = {key: value for key in BeamLayout.model_fields if (value := getattr(other, key)) is not None}
    dvl = checked(Dvl, kept | beams, f"scenario {scenario.name} with geometry {geometry}: dvl")
    return scenario.model_copy(update={"dvl": dvl})


def readings_of_scenario(scenario: Scenario, *, run: int = 0, altitude_m: float = 20.0) -> Readings:
    """The readings of run `run`; they equal those of that run in a campaign.

    Args:
        scenario: the scenario.
        run: number of the run.
        altitude_m: over the bottom, for the ranges of a scenario without a seabed.

    Raises:
        ScenarioError: as `build_simulation`.
        DataError: for a truth of less than a second.
    """
    simulation = build_simulation(scenario)
    truth = simulation.truth()
    streams = sensor_streams(simulation, truth, run=run)
    table, imu, depth = streams["beams"], streams["imu"], streams["depth"]
    geometry = simulation.geometry
    beam_mps = _of_beams(table, "mps", geometry.beams)
    range_m = _of_beams(table, "range_m", geometry.beams) if "beam1_range_m" in table.columns else None
    time_ns = table["time_ns"].to_numpy()
    return Readings(
        name=scenario.name,
        geometry=geometry,
        beam_sd_mps=np.full(geometry.beams, scenario.dvl.beam_noise_mps),
        time_ns=time_ns,
        beam_mps=beam_mps,
        range_m=ranges_or_flat(range_m, beam_mps, geometry, altitude_m),
        stated=np.ones(len(time_ns), dtype=bool),
        imu=Inertial(
            imu["time_ns"].to_numpy(),
            force_p_mps2=imu.select(f"force_{axis}_mps2" for axis in "xyz").to_numpy(),
            omega_p_radps=imu.select(f"omega_{axis}_radps" for axis in "xyz").to_numpy(),
        ),
        depth=Depths(depth["time_ns"].to_numpy(), depth["depth_m"].to_numpy()) if depth.height else None,
        truth=_states(truth, time_ns),
        water_mps=_water(streams.get("beams_water"), time_ns, geometry.beams),
        water_range_m=scenario.water_track.range_m,
        water_sd_mps=scenario.water_track.noise_mps,
    )


def _water(table: pl.DataFrame | None, time_ns: np.ndarray, beams: int) -> Floats | None:
    """(n, beams) what the water returned at each ping of the bottom, NaN where nothing; None without water track."""
    if table is None:
        return None
    water = np.full((len(time_ns), beams), np.nan)
    rows = np.searchsorted(time_ns, table["time_ns"].to_numpy())
    water[rows] = _of_beams(table, "mps", beams)
    return water


def _of_beams(table: pl.DataFrame, quantity: str, beams: int) -> Floats:
    """(n, beams) a quantity, NaN where there is none."""
    return numbers_of(table, [f"beam{k + 1}_{quantity}" for k in range(beams)], "run")


def _states(truth: Truth, time_ns: np.ndarray) -> TrueStates:
    """True states at the last sample up to each ping."""
    at = np.clip(np.searchsorted(truth.time_ns, time_ns, side="right") - 1, 0, None)
    return TrueStates(truth.position_t_m[at], truth.velocity_p_mps[at], euler_rad(truth.attitude_t_p[at]))


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
        stated=np.asarray(table.instrument_valid != 0),
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
