"""A run of a scenario as a mission of the benchmark: for tests and comparisons, no part of the benchmark's own data."""

import zlib
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.config.scenario import Scenario
from bottomlock.recordings.streams import Inertial
from bottomlock.simulation.build import Simulation, build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from partialdvl_bench.methods import estimate
from partialdvl_bench.mission import Estimates, Mission, Pings, Scalars, Start, Truth

Floats = NDArray[np.float64]


def scenario_mission(scenario: Scenario, run: int = 0, *, simulation: Simulation | None = None) -> Mission:
    """The readings of one run, with inertial means over each interval, and a start with random errors of its own.

    Args:
        scenario: any; the start errors are drawn from its seed, name and the run.
        run: number of the run.
        simulation: the scenario as built, where it is at hand already (with `imu.sampling` "averaged").

    Returns:
        A mission whose grid is the whole seconds after the start.
    """
    scenario = scenario.replace({"imu.sampling": "averaged"})
    simulation = build_simulation(scenario) if simulation is None else simulation
    truth = simulation.truth()
    streams = sensor_streams(simulation, truth, run=run)
    model, options = scenario.kernel_model(simulation.gravity_mps2), scenario.kernel_options()
    imu, beams = streams["imu"], streams["beams"]
    count = simulation.geometry.beams
    velocity = beams.select(f"beam{k + 1}_mps" for k in range(count)).fill_null(np.nan).to_numpy()
    time_ns = imu["time_ns"].to_numpy()
    grid_ns = np.arange(1_000_000_000, time_ns[-1] + 1, 1_000_000_000, dtype=np.int64)
    return Mission(
        name=f"{scenario.name}_{run}",
        split="none",
        geometry=simulation.geometry,
        model=model,
        options=options,
        start=_start(scenario, model.initial.as_dict(), truth, run),
        imu=Inertial(
            time_ns=time_ns,
            omega_p_radps=imu.select("omega_x_radps", "omega_y_radps", "omega_z_radps").to_numpy(),
            force_p_mps2=imu.select("force_x_mps2", "force_y_mps2", "force_z_mps2").to_numpy(),
        ),
        pings=Pings(beams["time_ns"].to_numpy(), velocity, np.isfinite(velocity)),
        depth=_scalars(streams["depth"], "depth_m"),
        heading=_scalars(streams["heading"], "heading_rad"),
        grid_ns=grid_ns,
        truth=_truth_at(truth, grid_ns),
    )


def tightly_coupled(mission: Mission, method: str = "tc", **changes: Any) -> Estimates:  # noqa: ANN401 - `Options` checks
    """The kernel's answer to a mission, with other options where they are given."""
    options = mission.options.replace(imu_sampling="averaged", **changes)
    return estimate(replace(mission, options=options), method)


def _start(scenario: Scenario, sd: dict[str, Any], truth: Any, run: int) -> Start:  # noqa: ANN401 - either truth
    key = [scenario.campaign.seed, zlib.crc32(scenario.name.encode()), run]
    errors = np.random.default_rng(key).normal(size=(3, 3))
    true = Rotation.from_quat(truth.attitude_t_p[0], scalar_first=True)
    # True minus estimate, R = Exp([rho x]) R_estimate.
    attitude = Rotation.from_rotvec(-errors[1] * sd["attitude_sd_rad"]) * true
    return Start(
        time_ns=int(truth.time_ns[0]),
        position_t_m=truth.position_t_m[0] - errors[0] * sd["position_sd_m"],
        velocity_p_mps=truth.velocity_p_mps[0] - errors[2] * sd["velocity_sd_mps"],
        attitude_t_p=attitude.as_quat(scalar_first=True),
    )


def _scalars(table: Any, column: str) -> Scalars:  # noqa: ANN401 - a frame
    return Scalars(table["time_ns"].to_numpy(), table[column].to_numpy())


def _truth_at(truth: Any, time_ns: NDArray[np.int64]) -> Truth:  # noqa: ANN401 - the simulator's truth
    rows = np.searchsorted(truth.time_ns, time_ns)
    return Truth(
        time_ns,
        truth.position_t_m[rows],
        truth.velocity_p_mps[rows],
        truth.attitude_t_p[rows],
        np.full((len(rows), 2), np.nan),
    )
