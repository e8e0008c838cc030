"""The command `bottomlock fly`: truth, telemetry and sensor streams of a scenario."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, say
from bottomlock.cli.parameters import Out, check_option, load_scenarios
from bottomlock.errors import ScenarioError

if TYPE_CHECKING:
    import numpy as np
    import polars as pl

    from bottomlock.config.scenario import Scenario
    from bottomlock.config.scenario_sections import Dvl
    from bottomlock.files.overwriting import Files
    from bottomlock.simulation.build import Simulation
    from bottomlock.truth import Truth


def fly(
    *scenario: str,
    out: Out = None,
    dry_run: bool = False,
    vehicle: str | None = None,
    sensors: int | None = None,
    force: Force = False,
) -> None:
    """Simulate the vehicle, or fly a trajectory from a file: truth, telemetry, figure.

    Args:
        scenario: Packaged scenarios (see `bottomlock list scenarios`) or TOML files, one or more.
        out: Directory for tables and figures.
        dry_run: Only print what the motion is like; nothing is written.
        vehicle: Packaged vehicle or TOML file; the scenario's own by default.
        sensors: Number of a run: write its sensor readings, a table per sensor, and the DVL's geometry.
    """
    from bottomlock.campaign.folder import identity_of
    from bottomlock.files.overwriting import Result
    from bottomlock.simulation.build import build_simulation

    loaded = load_scenarios(scenario)
    check_option("--sensors", sensors, "a run number, 0 or more", holds=sensors is None or sensors >= 0)
    if out is None and not dry_run:
        raise ScenarioError("no directory is named", expected="--out DIR, or --dry-run")
    simulations = [build_simulation(_with_vehicle(its, vehicle)) for its in loaded]
    result = None
    if out is not None and not dry_run:
        made_from = {
            simulation.scenario.name: identity_of([simulation])["configuration_hash"]
            for simulation in simulations
        }
        if sensors is not None:
            made_from["--sensors"] = str(sensors)
        inputs = [file for simulation in simulations for file in simulation.scenario.files()]
        result = Result(out, "fly", "fly", made_from, [*map(Path, scenario), *inputs])
        result.check(force=force)
    files: Files = {}
    for simulation in simulations:
        shown = _along_path if simulation.scenario.trajectory.source == "file" else _of_vehicle
        files |= shown(simulation, sensors, dry_run=dry_run)
    if result is not None:
        result.write(files, force=force)
        say(f"tables and figures in {out}")


def _with_vehicle(scenario: Scenario, vehicle: str | None) -> Scenario:
    """The scenario with its own vehicle or another one; unless its trajectory is a file."""
    if scenario.trajectory.source != "file":
        change = {"source": "vehicle"} | ({} if vehicle is None else {"vehicle": vehicle})
        return scenario.with_trajectory(**change)
    if vehicle is not None:
        raise ScenarioError(f"is given, but the trajectory of {scenario.name} is a file", key="--vehicle")
    return scenario


def _of_vehicle(simulation: Simulation, sensors: int | None, *, dry_run: bool) -> Files:
    """Prints what the motion is like; the files are none of a dry run."""
    import numpy as np

    from bottomlock.figures.drawing import on_paper
    from bottomlock.figures.flight import flight_figure, path_figure
    from bottomlock.figures.palette import figure_files
    from bottomlock.files.atomic_write import parquet_bytes
    from bottomlock.plant import telemetry
    from bottomlock.statistics.rms import rms

    name, flight = simulation.scenario.name, simulation.flight()
    frame = telemetry(flight)
    files: Files = {}
    if not dry_run:
        beams = _beams(simulation, flight.truth)
        files = _files(simulation, flight.truth, beams, sensors)
        files[f"{name}_telemetry.parquet"] = parquet_bytes(frame)
        files |= figure_files(on_paper(path_figure(frame, name)), f"{name}_path")
        files |= figure_files(on_paper(flight_figure(frame, beams)), f"{name}_motion")
    legs = frame.filter("leg") if frame["leg"].any() else frame
    cross_track_rms_m = float(rms(legs["cross_track_m"].to_numpy()))
    speed, sway = (frame[f"{part}_mps"].to_numpy() for part in ("speed", "sway"))
    console.print(
        f"{name}: {speed.mean():.3f} m/s, cross-track {cross_track_rms_m:.2f} m RMS, "
        f"largest sway {np.abs(sway).max():.3f} m/s"
    )
    return files


def _along_path(simulation: Simulation, sensors: int | None, *, dry_run: bool) -> Files:
    """As `_of_vehicle`, of a trajectory from a file."""
    from bottomlock.simulation.build import closure

    truth, summary = simulation.along_path()
    files = {} if dry_run else _files(simulation, truth, _beams(simulation, truth), sensors)
    position_m, attitude_rad = closure(simulation, truth)
    console.print(f"{simulation.scenario.name}:")
    for line in summary.lines():
        say(f"  {line}")
    say(
        f"  strapdown of perfect samples at {simulation.scenario.imu.rate_hz:g} Hz returns within "
        f"{1000.0 * position_m:.2g} mm and {attitude_rad:.1g} rad"
    )
    return files


def _files(simulation: Simulation, truth: Truth, beams: pl.DataFrame, sensors: int | None) -> Files:
    """Truth and beams, and with `sensors` the readings of that run and the DVL's geometry."""
    import polars as pl

    from bottomlock.files.atomic_write import parquet_bytes
    from bottomlock.simulation.sensor_streams import sensor_streams

    name = simulation.scenario.name
    tables = {"truth": pl.DataFrame(_wide(truth)), "beams": beams}
    if sensors is not None:
        streams = sensor_streams(simulation, truth, run=sensors)
        tables |= {f"run{sensors}_{sensor}": readings for sensor, readings in streams.items()}
    files: Files = {f"{name}_{end}.parquet": parquet_bytes(table) for end, table in tables.items()}
    if sensors is not None:
        files[f"{name}_dvl.toml"] = geometry_file(simulation.scenario.dvl)
    return files


def geometry_file(dvl: Dvl) -> str:
    """The DVL as the geometry file that audit, fix and replay read."""
    from bottomlock.config.scenario_sections import Dvl
    from bottomlock.io.beams import InstrumentFile

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
    import polars as pl

    from bottomlock.simulation.build import trajectory_key
    from bottomlock.simulation.measurement_schedule import schedule_and_footprints

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
