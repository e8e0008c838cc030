"""Readings of one simulated run: its drawn sensor errors, its beams lost by the scenario's own rules."""

import numpy as np
import polars as pl
from pydantic import ValidationError

from bottomlock.config.scenario import Scenario
from bottomlock.config.scenario_sections import Dvl
from bottomlock.config.validation import refusal
from bottomlock.instruments.readings import Floats, Readings, TrueStates, ranges_or_flat
from bottomlock.io.beams import read_instrument_file
from bottomlock.plant.telemetry import euler_rad
from bottomlock.recordings.streams import Depths, Inertial
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from bottomlock.truth.truth import Truth

_INSTRUMENT = (
    "configuration", "tilt_deg", "tilts_deg", "azimuths_deg", "directions", "lever_arms_m", "mounting_roll_deg",
    "mounting_pitch_deg", "mounting_yaw_deg", "sound_speed_scale",
)  # fmt: skip


def with_geometry(scenario: Scenario, geometry: str) -> Scenario:
    """The scenario with the beams of another DVL; its errors and its rules of loss stay.

    Raises:
        ScenarioError: for a geometry that cannot be read, or rules that name beams that it does not have.
    """
    other = read_instrument_file(geometry)
    kept = {k: v for k, v in scenario.dvl.model_dump(exclude_unset=True).items() if k not in _INSTRUMENT}
    beams = {key: value for key in _INSTRUMENT if (value := getattr(other, key)) is not None}
    try:
        dvl = Dvl.model_validate(kept | beams)
    except ValidationError as error:
        place = f"scenario {scenario.name} with geometry {geometry}: dvl"
        raise refusal(error, place, Dvl) from error
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
    numbers = range(1, geometry.beams + 1)
    beam_mps: Floats = table.select(f"beam{k}_mps" for k in numbers).fill_null(np.nan).to_numpy()
    range_m = None
    if "beam1_range_m" in table.columns:
        range_m = table.select(f"beam{k}_range_m" for k in numbers).fill_null(np.nan).to_numpy()
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
    water[rows] = table.select(f"beam{k}_mps" for k in range(1, beams + 1)).fill_null(np.nan).to_numpy()
    return water


def _states(truth: Truth, time_ns: np.ndarray) -> TrueStates:
    """True states at the last sample up to each ping."""
    at = np.clip(np.searchsorted(truth.time_ns, time_ns, side="right") - 1, 0, None)
    return TrueStates(truth.position_t_m[at], truth.velocity_p_mps[at], euler_rad(truth.attitude_t_p[at]))
