"""Errors of instruments that last: a filter that expects them is consistent, others are overconfident."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import bottomlock
from bottomlock.config.instrument_grades import imu
from bottomlock.kernel import Method
from bottomlock.kernel.models import DepthModel, DvlModel, HeadingModel, MagnetometerModel, Settings
from bottomlock.statistics.chi_squared import mean_band
from tests.analytic import analytic_simulation
from tests.statistical import ensembles

pytestmark = [pytest.mark.statistical, pytest.mark.slow]

RUNS = 60
METHODS: tuple[Method, ...] = ("tc", "sway_current")
DEGREE = np.pi / 180.0


@dataclass(frozen=True)
class Slow:
    """A section of the model with the errors and without, its column of zeros, the state overclaimed without them."""

    section: str
    errors: Settings
    white: Settings
    column: str | None
    trajectory_key: int
    state: int
    least_over: float


TACTICAL = imu("tactical").replace(
    accel_warm_up_sd_mps2=0.0,
    gyro_warm_up_sd_radps=0.0,
    gyro_g_sensitivity_sd_radps_per_mps2=0.0,
    accel_scale_sd=0.0,
)
BY_FORCE = TACTICAL.replace(
    gyro_scale_sd=0.0,
    gyro_misalignment_sd_rad=0.0,
    gyro_g_sensitivity_sd_radps_per_mps2=2e-4,
    accel_scale_sd=1.3e-2,
)
COLD = TACTICAL.replace(
    gyro_scale_sd=0.0, gyro_misalignment_sd_rad=0.0, accel_warm_up_sd_mps2=0.02, gyro_warm_up_sd_radps=1e-4,
    warm_up_time_s=100.0,
)  # fmt: skip
DEPTH = DepthModel(sd_m=0.02, bias_sd_m=0.3, bias_time_s=600.0)
BEAMS = DvlModel(
    beam_noise_sd_mps=0.01, beam_noise_sd_mps_per_m=1e-3, beam_bias_sd_mps=0.005, beam_bias_walk_mps_rts=5e-5,
    scale_factor_sd=0.007, scale_factor_walk_rts=5e-5,
)  # fmt: skip
SENSORS = {
    "magnetometer": Slow(
        "magnetometer",
        MagnetometerModel(
            yaw_sd_rad=0.5 * DEGREE, roll_pitch_sd_rad=0.2 * DEGREE, yaw_offset_sd_rad=2.0 * DEGREE,
            roll_pitch_offset_sd_rad=0.5 * DEGREE, yaw_walk_sd_rad=1.0 * DEGREE, roll_pitch_walk_sd_rad=0.3 * DEGREE,
            walk_time_s=60.0, yaw_semicircular_sd_rad=2.0 * DEGREE, yaw_quadrantal_sd_rad=1.0 * DEGREE,
        ),
        MagnetometerModel(yaw_sd_rad=0.5 * DEGREE, roll_pitch_sd_rad=0.2 * DEGREE),
        column="yaw_offset_rad", trajectory_key=47, state=5, least_over=3.0,
    ),
    "heading": Slow(
        "heading",
        HeadingModel(
            sd_rad=0.1 * DEGREE, offset_sd_rad=0.5 * DEGREE, walk_sd_rad=0.3 * DEGREE, walk_time_s=100.0,
            semicircular_sd_rad=1.0 * DEGREE, quadrantal_sd_rad=0.5 * DEGREE,
        ),
        HeadingModel(sd_rad=0.1 * DEGREE),
        column=None, trajectory_key=47, state=5, least_over=3.0,
    ),
    "depth": Slow(
        "depth", DEPTH, DEPTH.replace(bias_sd_m=0.0), column="depth_offset_m", trajectory_key=31, state=2,
        least_over=5.0,
    ),
    "waves": Slow(
        "depth", DEPTH.replace(bias_sd_m=0.05, wave_sd_m=0.35), DEPTH.replace(bias_sd_m=0.05),
        column="depth_offset_m", trajectory_key=31, state=2, least_over=2.0,
    ),
    "gyros": Slow(
        "imu", TACTICAL, TACTICAL.replace(gyro_scale_sd=0.0, gyro_misalignment_sd_rad=0.0),
        column=None, trajectory_key=53, state=3, least_over=1.5,
    ),
    "beams": Slow(
        "dvl", BEAMS, BEAMS.replace(beam_noise_sd_mps_per_m=0.0), column=None, trajectory_key=61, state=6,
        least_over=1.5,
    ),
    "forces": Slow(
        "imu", BY_FORCE, BY_FORCE.replace(gyro_g_sensitivity_sd_radps_per_mps2=0.0, accel_scale_sd=0.0),
        column=None, trajectory_key=67, state=3, least_over=1.5,
    ),
    "warm-up": Slow(
        "imu", COLD, COLD.replace(accel_warm_up_sd_mps2=0.0, gyro_warm_up_sd_radps=0.0),
        column=None, trajectory_key=59, state=3, least_over=1.5,
    ),
}  # fmt: skip


@lru_cache(maxsize=12)
def flown(sensor: str, *, expected: bool) -> dict[str, Any]:
    """Runs on the figure of eight with beams 1 and 2 and one sensor, its slow errors expected or not."""
    simulation = analytic_simulation("figure_eight", imu_hz=50.0)
    scenario, truth = simulation.scenario, simulation.truth()
    schedule: Any = bottomlock.measurement_schedule(simulation, truth)
    schedule["beam_valid"] = np.tile([True, True, False, False], (len(schedule["dvl_time_ns"]), 1))
    # Away from the bottom, one beam more than the other.
    schedule["beam_range_m"] = np.linspace([5.0] * 4, [60.0, 40.0] * 2, len(schedule["dvl_time_ns"]))
    slow = SENSORS[sensor]
    if slow.section not in {"imu", "dvl"}:
        schedule[f"{slow.section}_time_ns"] = schedule["dvl_time_ns"]
    if slow.column is not None:
        schedule[slow.column] = np.zeros(len(schedule["dvl_time_ns"]))
    schedule["sample_time_ns"] = schedule["sample_time_ns"][49::50]
    model = scenario.kernel_model(simulation.gravity_mps2).replace(**{slow.section: slow.errors})
    assumed = model.replace(**{slow.section: slow.errors if expected else slow.white})
    options = scenario.kernel_options().replace(gate="off")
    arrays: Any = truth.kernel_arrays()
    return dict(
        bottomlock.run_batch(
            simulation.geometry, arrays, model, assumed, options, schedule, METHODS,
            seed=ensembles.SEED, trajectory_key=slow.trajectory_key, first_run=0, runs=RUNS, threads=1,
        )
    )  # fmt: skip


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("sensor", SENSORS)
def test_a_filter_that_expects_them_is_consistent(sensor: str) -> None:
    """NEES of velocity and attitude and of the whole state, at every sample time; the false-alarm rate is 1 %."""
    batch = flown(sensor, expected=True)
    samples = batch["nees"].shape[2]
    each = 1.0 - 0.01 / (2 * samples * len(METHODS))
    for quantity, degrees in (("nees_velocity_attitude", 6.0), ("nees", 20.0)):
        _, high = mean_band(degrees, RUNS, each)
        means = batch[quantity].mean(axis=0)
        assert (means < high).all(), (quantity, means)


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("sensor", SENSORS)
def test_a_filter_that_takes_them_for_white_is_overconfident(sensor: str) -> None:
    """In yaw or depth it averages away in its covariance what does not average away in the world."""
    slow = SENSORS[sensor]
    for expected in (True, False):
        batch = flown(sensor, expected=expected)
        normalised = batch["error"][:, :, -1, slow.state] / batch["sd"][:, :, -1, slow.state]
        over = np.sqrt((normalised**2).mean(axis=0))
        assert (over < 1.4).all() if expected else (over > slow.least_over).all(), over
