"""The command `bottomlock fly`: truth, telemetry and sensor streams of a scenario."""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import polars as pl
from cyclopts import Parameter

from bottomlock.atomic_write import write_parquet, write_text
from bottomlock.cli.console import console
from bottomlock.config.scenario import load_scenario
from bottomlock.config.scenario_sections import Dvl
from bottomlock.errors import ScenarioError
from bottomlock.figures.flight import flight_figure, save_figure
from bottomlock.io.beams import InstrumentFile
from bottomlock.plant import telemetry
from bottomlock.simulation.build import Simulation, build_simulation, trajectory_key
from bottomlock.simulation.closure import closure
from bottomlock.simulation.measurement_schedule import schedule_and_footprints
from bottomlock.simulation.sensor_streams import sensor_streams
from bottomlock.statistics.rms import rms
from bottomlock.truth.truth import Truth


def fly(
    *scenario: str,
    out: Annotated[Path | None, Parameter(alias="-o", help="Directory for tables and figures.")] = None,
    dry_run: Annotated[
        bool, Parameter(negative="", help="Only print what the motion is like; nothing is written.")
    ] = False,
    vehicle: Annotated[
        str | None, Parameter(help="Packaged vehicle or TOML file; the scenario's own by default.")
    ] = None,
    sensors: Annotated[
        int | None,
        Parameter(
            help="Number of a run: write its sensor readings, a table per sensor, and the DVL's geometry."
        ),
    ] = None,
) -> None:
    """Simulate the vehicle, or fly a trajectory from a file: truth, telemetry, figure.

    Parameters
    ----------
    scenario
        Packaged scenarios (see `bottomlock scenarios`) or TOML files, one or more.
    """
    if not scenario:
        raise ScenarioError("no scenario is named; `bottomlock scenarios` lists the packaged ones")
    if sensors is not None and sensors < 0:
        raise ScenarioError(f"--sensors is {sensors}, expected a run number, 0 or more")
    if out is None and not dry_run:
        raise ScenarioError("no directory is named, expected --out DIR, or --dry-run")
    for name in scenario:
        loaded = load_scenario(name)
        if loaded.trajectory.source == "file":
            if vehicle is not None:
                raise ScenarioError(f"--vehicle is given, but the trajectory of {loaded.name} is a file")
            _along_path(build_simulation(loaded), None if dry_run else out, sensors)
        else:
            change = {"source": "vehicle"} | ({} if vehicle is None else {"vehicle": vehicle})
            _of_vehicle(build_simulation(loaded.with_trajectory(**change)), None if dry_run else out, sensors)
    if not dry_run:
        console.print(f"tables and figures in {out}")


def _of_vehicle(simulation: Simulation, out: Path | None, sensors: int | None) -> None:
    name, flight = simulation.scenario.name, simulation.flight()
    frame = telemetry(flight)
    if out is not None:
        beams = _beams(simulation, flight.truth)
        _write(simulation, flight.truth, beams, out, sensors)
        write_parquet(out / f"{name}_telemetry.parquet", frame)
        save_figure(flight_figure(frame, beams), out / f"{name}.png")
    legs = frame.filter("leg") if frame["leg"].any() else frame
    cross_track_rms_m = float(rms(legs["cross_track_m"].to_numpy()))
    speed, sway = (frame[f"{part}_mps"].to_numpy() for part in ("speed", "sway"))
    console.print(
        f"{name}: {speed.mean():.3f} m/s, cross-track {cross_track_rms_m:.2f} m RMS, "
        f"largest sway {np.abs(sway).max():.3f} m/s"
    )


def _along_path(simulation: Simulation, out: Path | None, sensors: int | None) -> None:
    truth, summary = simulation.along_path()
    if out is not None:
        _write(simulation, truth, _beams(simulation, truth), out, sensors)
    position_m, attitude_rad = closure(simulation, truth)
    console.print(f"{simulation.scenario.name}:")
    for line in summary.lines():
        console.print(f"  {line}", soft_wrap=True)
    console.print(
        f"  strapdown of perfect samples at {simulation.scenario.imu.rate_hz:g} Hz returns within "
        f"{1000.0 * position_m:.2g} mm and {attitude_rad:.1g} rad",
        soft_wrap=True,
    )


def _write(simulation: Simulation, truth: Truth, beams: pl.DataFrame, out: Path, sensors: int | None) -> None:
    """Truth and beams, and with `sensors` the readings of that run and the DVL's geometry."""
    name = simulation.scenario.name
    write_parquet(out / f"{name}_truth.parquet", pl.DataFrame(_wide(truth)))
    write_parquet(out / f"{name}_beams.parquet", beams)
    if sensors is not None:
        for sensor, readings in sensor_streams(simulation, truth, run=sensors).items():
            write_parquet(out / f"{name}_run{sensors}_{sensor}.parquet", readings)
        write_text(out / f"{name}_dvl.toml", geometry_file(simulation.scenario.dvl))


def geometry_file(dvl: Dvl) -> str:
    """The DVL as the geometry file that audit, fix and replay read."""
    shared = [key for key in InstrumentFile.model_fields if key in Dvl.model_fields]
    values = {key: getattr(dvl, key) for key in shared}
    unused = {
        "x": {"tilts_deg", "azimuths_deg", "directions"},
        "+": {"tilts_deg", "azimuths_deg", "directions"},
    }
    unused |= {"angles": {"tilt_deg", "directions"}, "directions": {"tilt_deg", "tilts_deg", "azimuths_deg"}}
    lines = [
        f"{key} = {json.dumps(value)}"
        for key, value in values.items()
        if value is not None and key not in unused[dvl.configuration]
    ]
    return "\n".join(lines) + "\n"


def _beams(simulation: Simulation, truth: Truth) -> pl.DataFrame:
    """Which beams return in the first run and, over a seabed, at which range (m) and incidence (rad)."""
    schedule, hits = schedule_and_footprints(
        simulation, truth, trajectory_key=trajectory_key(simulation.scenario.name)
    )
    valid = schedule["beam_valid"].reshape(-1, simulation.geometry.beams)
    columns = {"time_ns": schedule["dvl_time_ns"]}
    for k in range(simulation.geometry.beams):
        columns[f"beam{k + 1}_valid"] = valid[:, k]
        if hits is not None:
            columns[f"beam{k + 1}_range_m"] = hits.range_m[:, k]
            columns[f"beam{k + 1}_incidence_rad"] = hits.incidence_rad[:, k]
    return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None))


def _wide(truth: Truth) -> dict[str, np.ndarray[Any, Any]]:
    """A truth as columns: one per component."""
    columns: dict[str, np.ndarray[Any, Any]] = {"time_ns": truth.time_ns}
    for name, values in truth.kernel_arrays().items():
        if name != "time_ns":
            axes = "wxyz" if values.shape[1] == 4 else "xyz"
            columns |= {f"{name}_{axis}": values[:, k] for k, axis in enumerate(axes)}
    return columns
