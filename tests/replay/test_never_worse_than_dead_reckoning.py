"""The floor: no trusted method is worse in position than dead reckoning, and each is right about its error.

Simulated dives, each with another draw of every sensor's errors, outliers among the beams and a cross-current. Both
have the same compass, whose error lasts, so dead reckoning may be lucky on a dive: compared are RMS over the dives.
"""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from bottomlock.cli.simulate import geometry_file
from bottomlock.config.scenario import load_scenario
from bottomlock.replay.case import parse_case
from bottomlock.simulation.build import build_simulation
from bottomlock.simulation.sensor_streams import sensor_streams
from tests.replay.undiagnosed import replay_undiagnosed
from tests.toml_text import toml

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

TRUSTED = ("tc", "weak_sway", "sway_current")
DEAD_RECKONING = "dead_reckoning"
LARGEST_RATIO = 1.05
"""RMS of a method over that of dead reckoning."""
BAND = (0.7, 1.4)
"""Error over claimed sigma of the position."""
SLOW = {"yaw_offset_sd_deg": 2.0, "yaw_walk_sd_deg": 1.0, "roll_pitch_walk_sd_deg": 0.3, "walk_time_s": 120.0}
WORLDS = {
    "survey": {},
    "mti": {
        "accel_bias_mg": 20.0, "gyro_bias_deg_per_h": 3600.0, "accel_noise_mps_per_rt_h": 0.1,
        "gyro_noise_deg_per_rt_h": 3.0, "gyro_bias_walk_deg_per_s_per_rt_s": 1e-3,
        "accel_bias_walk_mps2_per_rt_s": 1e-4,
    },
}  # fmt: skip
"""IMU of the survey scenario, fibre-optic, and one of the MTi class with vibration: keys of [imu]."""


def scores(world: str, runs: int, folder: Path) -> pl.DataFrame:
    """Mean square of the horizontal error and of its claimed sigma, a row a dive and method."""
    scenario = load_scenario("survey")
    imu = scenario.imu.model_copy(update=WORLDS[world])
    compass = scenario.magnetometer.model_copy(
        update={"rate_hz": 5.0, "yaw_noise_deg": 0.2, "roll_pitch_noise_deg": 0.1, **SLOW}
    )
    scenario = scenario.model_copy(update={"imu": imu, "magnetometer": compass}).with_trajectory(
        duration_s=300.0
    )
    simulation = build_simulation(scenario)
    truth = simulation.truth()
    arrays = truth.kernel_arrays()
    columns = {"time_ns": arrays["time_ns"]}
    for key, names in (
        ("position_t_m", ("north_m", "east_m", "down_m")),
        ("velocity_p_mps", ("surge_mps", "sway_mps", "heave_mps")),
    ):
        columns |= {name: np.asarray(arrays[key])[:, axis] for axis, name in enumerate(names)}
    pl.DataFrame(columns).gather_every(100).write_parquet(folder / "truth.parquet")
    (folder / "dvl.toml").write_text(geometry_file(scenario.dvl), encoding="utf-8")
    errors = {key: getattr(imu, key) for key in type(imu).model_fields if key.startswith(("accel_", "gyro_"))}
    text = toml({
        "": {"name": "floor"},
        "origin": {"latitude_deg": 32.8},
        "imu": {
            "file": "imu.parquet", "clock": {"column": "time_ns", "unit": "ns"},
            "force": ["force_x_mps2", "force_y_mps2", "force_z_mps2"],
            "omega": ["omega_x_radps", "omega_y_radps", "omega_z_radps"], "sampling": "averaged",
        },
        "imu.errors": errors,
        "dvl": {"file": "beams.parquet", "geometry": "dvl.toml"},
        "dvl.errors": {"beam_bias_mps": 0.002, "scale_factor_percent": 0.4},
        "depth": {
            "file": "depth.parquet", "clock": {"column": "time_ns", "unit": "ns"}, "column": "depth_m",
            "sd_m": 0.02,
        },
        "attitude": {
            "file": "attitude.parquet", "clock": {"column": "time_ns", "unit": "ns"}, "roll": "roll_rad",
            "pitch": "pitch_rad", "yaw": "yaw_rad", "aids": "attitude", "roll_pitch_sd_deg": 0.1,
            "yaw_sd_deg": 0.2, **SLOW,
        },
        "reference": {
            "file": "truth.parquet", "clock": {"column": "time_ns", "unit": "ns"}, "north": "north_m",
            "east": "east_m", "down": "down_m", "velocity_body": ["surge_mps", "sway_mps", "heave_mps"],
        },
        "start": {
            "at_s": 4.0, "level": "attitude", "heading": "attitude", "velocity": "reference",
            "velocity_sd_mps": [0.05] * 3, "position": "reference", "position_sd_m": [0.1] * 3,
        },
        "replay": {"methods": TRUSTED, "smooth": False},
    })  # fmt: skip
    case = parse_case(text, place="floor", folder=folder)
    rows: list[pl.DataFrame] = []
    for run in range(runs):
        for sensor, readings in sensor_streams(simulation, truth, run=run).items():
            readings.write_parquet(folder / f"{sensor}.parquet")
        samples = replay_undiagnosed(case).samples
        squared = pl.col("err_position_north_m") ** 2 + pl.col("err_position_east_m") ** 2
        claimed = pl.col("sd_position_north_m") ** 2 + pl.col("sd_position_east_m") ** 2
        rows.append(samples.group_by("method").agg(error_m2=squared.mean(), claimed_m2=claimed.mean()))
    return pl.concat(rows)


@pytest.mark.parametrize(
    ("world", "runs"), [("survey", 6), *(pytest.param(world, 30, marks=pytest.mark.long) for world in WORLDS)]
)
def test_the_floor(world: str, runs: int, tmp_path: Path) -> None:
    found = scores(world, runs, tmp_path).group_by("method").mean()
    mean = {method: (error_m2, claimed_m2) for method, error_m2, claimed_m2 in found.iter_rows()}
    floor_m2, _ = mean[DEAD_RECKONING]
    for method in TRUSTED:
        error_m2, claimed_m2 = mean[method]
        assert np.sqrt(error_m2 / floor_m2) <= LARGEST_RATIO, (world, method)
        assert BAND[0] <= np.sqrt(error_m2 / claimed_m2) <= BAND[1], (world, method)
