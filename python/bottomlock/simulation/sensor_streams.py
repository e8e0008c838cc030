"""The sensor readings of one run as tables: the input of its filters, for use with another filter."""

from typing import Any

import numpy as np
import polars as pl

from bottomlock import kernel
from bottomlock.config.sensors import SENSORS, Simulated, WaterTrack
from bottomlock.plant.beam_loss import noisy_ranges
from bottomlock.plant.flight import euler_rad
from bottomlock.simulation.build import Simulation, trajectory_key
from bottomlock.simulation.measurement_schedule import schedule_and_footprints
from bottomlock.truth import Truth

ANGLES = ("roll_rad", "pitch_rad", "yaw_rad")


def sensor_streams(simulation: Simulation, truth: Truth, *, run: int = 0) -> dict[str, pl.DataFrame]:
    """The sensor readings of one run along a truth, a table per sensor; they equal those of that run in a campaign.

    Returns:
        Tables with time_ns and: `imu`, omega_{x,y,z}_radps and force_{x,y,z}_mps2 in the platform frame; `beams`, for
        every beam beamK_mps, beamK_valid and, over a seabed, beamK_range_m, null where it does not return; `depth`,
        depth_m; `attitude`, attitude_{w,x,y,z} from platform to tangent, and the same as roll_rad, pitch_rad, yaw_rad;
        `gps`, position_{north,east,down}_m and velocity_{north,east,down}_mps; and a table of each further sensor of
        `config.sensors.SENSORS`, with its columns. A sensor that is off has no rows. With water track also
        `beams_water`: cell (1), range_m along the beam, and of every beam mps, valid, quality (null) and sd_mps.

    Raises:
        DataError: for a truth of less than a second.

    Examples:
        >>> from bottomlock.config.scenario import load_scenario
        >>> from bottomlock.simulation.build import build_simulation
        >>> simulation = build_simulation(load_scenario("straight").with_trajectory(duration_s=3.0))
        >>> sensor_streams(simulation, simulation.truth())["beams"].select("time_ns", "beam1_valid", "beam3_mps").row(0)
        (1000000000, True, None)
    """
    scenario = simulation.scenario
    key: dict[str, Any] = {
        "seed": scenario.campaign.seed,
        "trajectory_key": trajectory_key(scenario.name),
        "run": run,
    }
    conditions = schedule_and_footprints(
        simulation, truth, trajectory_key=key["trajectory_key"], first_run=run, runs=1
    )
    schedule: Any = conditions[0]
    hits = conditions[1]
    arrays: Any = truth.kernel_arrays()
    model, options = scenario.kernel_model(simulation.gravity_mps2), scenario.kernel_options()
    drawn = kernel.simulate_sensors(
        simulation.geometry,
        arrays,
        model,
        schedule,
        imu_sampling=scenario.imu.sampling,
        options=options,
        **key,
    )
    beams = {"time_ns": drawn["dvl_time_ns"]}
    valid = drawn["dvl_valid"]
    ranges = None if hits is None else noisy_ranges(hits.range_m, scenario.dvl.range_noise_m, **key)
    for k in range(simulation.geometry.beams):
        beams[f"beam{k + 1}_mps"] = np.where(valid[:, k], drawn["dvl_velocity_mps"][:, k], np.nan)
        beams[f"beam{k + 1}_valid"] = valid[:, k]
        if ranges is not None:
            beams[f"beam{k + 1}_range_m"] = np.where(valid[:, k], ranges[:, k], np.nan)
    imu = _columns("omega_{}_radps", "xyz", drawn["imu_omega_p_radps"])
    imu |= _columns("force_{}_mps2", "xyz", drawn["imu_force_p_mps2"])
    water = {"beams_water": _water(drawn, scenario.water_track)} if scenario.water_track.enabled else {}
    others = {sensor.table: pl.DataFrame(_readings(sensor, drawn)) for sensor in SENSORS}
    return (
        {
            "imu": pl.DataFrame({"time_ns": drawn["imu_time_ns"]} | imu),
            "beams": pl.DataFrame(beams).with_columns(pl.col(pl.Float64).fill_nan(None)),
        }
        | water
        | others
    )


def _water(drawn: dict[str, Any], settings: WaterTrack) -> pl.DataFrame:
    """The beams that the water returned: a cell a ping."""
    time_ns, valid = drawn["water_track_time_ns"], drawn["water_track_valid"]
    columns: dict[str, Any] = {
        "time_ns": time_ns,
        "cell": np.ones_like(time_ns),
        "range_m": np.full(len(time_ns), settings.range_m),
    }
    for k in range(valid.shape[1]):
        columns[f"beam{k + 1}_mps"] = np.where(valid[:, k], drawn["water_track_velocity_mps"][:, k], np.nan)
        columns[f"beam{k + 1}_valid"] = valid[:, k]
        columns[f"beam{k + 1}_quality"] = np.full(len(time_ns), np.nan)
        columns[f"beam{k + 1}_sd_mps"] = np.full(len(time_ns), settings.noise_mps)
    return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None))


def _readings(sensor: type[Simulated], drawn: dict[str, Any]) -> dict[str, Any]:
    columns = {"time_ns": drawn[f"{sensor.name}_time_ns"]}
    for array, names in sensor.columns.items():
        columns |= dict(zip(names, drawn[array].reshape(-1, len(names)).T, strict=True))
        if array.endswith("attitude_t_p"):
            # The same attitude as the audit and a replay read it.
            columns |= dict(zip(ANGLES, euler_rad(drawn[array]).T, strict=True))
    return columns


def _columns(name: str, axes: Any, values: np.ndarray[Any, Any]) -> dict[str, Any]:  # noqa: ANN401 - text or texts
    return {name.format(axis): values[:, k] for k, axis in enumerate(axes)}
