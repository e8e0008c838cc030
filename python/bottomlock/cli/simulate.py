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
from bottomlock.simulation.measurement_schedule import schedule_and_footprints
from bottomlock.simulation.sensor_streams import sensor_streams
from bottomlock.statistics.rms import rms
from bottomlock.truth.truth import Truth


def fly(
    *scenario: str,
    out: Annotated[Path, Parameter(help="Directory for tables and figures.")],
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
    """Simulate the vehicle: truth, telemetry and a figure per scenario.

    Parameters
    ----------
    scenario
        Packaged scenarios (see `bottomlock scenarios`) or TOML files, one or more.
    """
    if not scenario:
        raise ScenarioError("no scenario is named; `bottomlock scenarios` lists the packaged ones")
    if sensors is not None and sensors < 0:
        raise ScenarioError(f"--sensors is {sensors}, expected a run number, 0 or more")
    for name in scenario:
        loaded = load_scenario(name)
        change = {"source": "vehicle"} | ({} if vehicle is None else {"vehicle": vehicle})
        loaded = loaded.with_trajectory(**change)
        simulation = build_simulation(loaded)
        flight = simulation.flight()
        frame, beams = telemetry(flight), _beams(simulation, flight.truth)
        write_parquet(out / f"{loaded.name}_truth.parquet", pl.DataFrame(_wide(flight.truth)))
        write_parquet(out / f"{loaded.name}_telemetry.parquet", frame)
        write_parquet(out / f"{loaded.name}_beams.parquet", beams)
        save_figure(flight_figure(frame, beams), out / f"{loaded.name}.png")
        if sensors is not None:
            for sensor, readings in sensor_streams(simulation, flight.truth, run=sensors).items():
                write_parquet(out / f"{loaded.name}_run{sensors}_{sensor}.parquet", readings)
            write_text(out / f"{loaded.name}_dvl.toml", geometry_file(loaded.dvl))
        legs = frame.filter("leg") if frame["leg"].any() else frame
        cross_track_rms_m = float(rms(legs["cross_track_m"].to_numpy()))
        speed, sway = (frame[f"{part}_mps"].to_numpy() for part in ("speed", "sway"))
        console.print(
            f"{loaded.name}: {speed.mean():.3f} m/s, cross-track {cross_track_rms_m:.2f} m RMS, "
            f"largest sway {np.abs(sway).max():.3f} m/s"
        )
    console.print(f"tables and figures in {out}")


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
