"""Missions from a scenario, for tests and the study of convergence: the benchmark's own come from its data."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from benches.rivals import rotations
from bottomlock.config.scenario import Scenario
from bottomlock.kernel.models import InitialModel
from bottomlock.recordings.streams import Inertial, WaterBeams
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from bottomlock.truth import truth as truths
from partialdvl_bench.mission import Mission, Pings, Scalars, Start, Truth

Floats = NDArray[np.float64]

GRID_NS = 1_000_000_000


def mission_of(scenario: Scenario, *, run: int = 0) -> Mission:
    """A run of a scenario as a mission, asked each second; the start is drawn from the claimed uncertainty.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> mission_of(load_scenario("straight").with_trajectory(duration_s=3.0)).grid_ns
        array([1000000000, 2000000000, 3000000000])
    """
    simulation = build_simulation(averaged(scenario))
    return mission_along(simulation, simulation.truth(), run=run)


def averaged(scenario: Scenario) -> Scenario:
    """With inertial samples that are means over their interval, as those of a mission are."""
    return scenario.replace({"imu.sampling": "averaged"})


def mission_along(simulation: Simulation, truth: truths.Truth, *, run: int = 0) -> Mission:
    """A run along a truth that is at hand; its scenario's inertial samples are means (`averaged`)."""
    scenario = simulation.scenario
    streams = sensor_streams(simulation, truth, run=run)
    model, options = scenario.kernel_model(simulation.gravity_mps2), scenario.kernel_options()
    imu, beams = streams["imu"], streams["beams"]
    last_ns = int(imu["time_ns"][-1])
    grid_ns = np.arange(GRID_NS, last_ns + 1, GRID_NS, dtype=np.int64)
    rows = np.searchsorted(truth.time_ns, grid_ns)
    count = simulation.geometry.beams
    heading = streams["heading"]
    return Mission(
        name=f"{scenario.name}-{run}",
        split="train",
        geometry=simulation.geometry,
        model=model,
        options=options,
        start=drawn_start(truth, model.initial, np.random.default_rng([scenario.campaign.seed, run])),
        imu=Inertial(
            time_ns=imu["time_ns"].to_numpy(),
            omega_p_radps=imu.select(f"omega_{axis}_radps" for axis in "xyz").to_numpy(),
            force_p_mps2=imu.select(f"force_{axis}_mps2" for axis in "xyz").to_numpy(),
        ),
        pings=Pings(
            beams["time_ns"].to_numpy(),
            beams.select(f"beam{k + 1}_mps" for k in range(count)).fill_null(np.nan).to_numpy(),
            beams.select(f"beam{k + 1}_valid" for k in range(count)).to_numpy(),
        ),
        depth=Scalars(streams["depth"]["time_ns"].to_numpy(), streams["depth"]["depth_m"].to_numpy()),
        heading=Scalars(heading["time_ns"].to_numpy(), heading["heading_rad"].to_numpy()),
        grid_ns=grid_ns,
        truth=Truth(
            time_ns=grid_ns,
            position_t_m=truth.position_t_m[rows],
            velocity_p_mps=truth.velocity_p_mps[rows],
            attitude_t_p=truth.attitude_t_p[rows],
            current_t_mps=np.full((len(rows), 2), np.nan),
        ),
        water=_water(streams["beams_water"], count) if "beams_water" in streams else None,
    )


def _water(table: pl.DataFrame, count: int) -> WaterBeams:
    def of_beams(name: str) -> Floats:
        return table.select(f"beam{k + 1}_{name}" for k in range(count)).fill_null(np.nan).to_numpy()

    return WaterBeams(
        table["time_ns"].to_numpy(),
        of_beams("mps"),
        of_beams("valid").astype(np.bool_),
        of_beams("sd_mps"),
        table["range_m"].to_numpy(),
    )


def drawn_start(truth: truths.Truth, initial: InitialModel, generator: np.random.Generator) -> Start:
    """The true start less errors of the claimed 1 sigma."""
    sds = (initial.position_sd_m, initial.attitude_sd_rad, initial.velocity_sd_mps)
    position, misalignment, velocity = (sd * generator.standard_normal(3) for sd in sds)
    return wrong_start(truth, position, misalignment, velocity)


def wrong_start(truth: truths.Truth, position: Floats, misalignment: Floats, velocity: Floats) -> Start:
    """The true start less errors: position and misalignment in the tangent frame, velocity in platform axes, (3,)."""
    rotation = rotations.exp(-misalignment) @ rotations.matrix(truth.attitude_t_p[0])
    return Start(
        time_ns=int(truth.time_ns[0]),
        position_t_m=truth.position_t_m[0] - position,
        velocity_p_mps=truth.velocity_p_mps[0] - velocity,
        attitude_t_p=rotations.quaternion(rotation),
    )
