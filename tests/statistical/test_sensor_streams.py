"""Every simulated stream has the statistics its settings name; seeds are fixed, bands are two-sided at 0.1 % each."""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy import stats

import bottomlock
from tests.oracle import beams, truth
from tests.oracle.rotations import Array, log_rotation, matrix_from_quaternion
from tests.property import settings

pytestmark = pytest.mark.statistical

SEED = 20170222
RUNS, SECONDS, RATE_HZ = 400, 20, 10.0
JANUS = bottomlock.BeamGeometry.janus(beams.TILT_RAD)
MODEL = settings.table_2()


def chi_squared_fits(deviations: Array, sd: float) -> None:
    """Sum of squares of independent Gaussians of one sigma: chi-squared with their number, two-sided at 0.1 %."""
    n = deviations.size
    ratio = float(np.sum(deviations**2)) / sd**2
    chance = stats.chi2(n)
    assert chance.ppf(5e-4) < ratio < chance.ppf(1 - 5e-4), (
        f"sd {np.sqrt(ratio / n) * sd:.4g}, expected {sd:.4g}"
    )
    # The mean too: a constant would hide in the sum.
    assert abs(deviations.mean()) < 3.3 * sd / np.sqrt(n)


@lru_cache(maxsize=1)
def motion() -> Any:  # noqa: ANN401 - the kernel's dict of a truth
    return truth.make(yaw=truth.figure_eight_yaw, seconds=SECONDS, rate_hz=RATE_HZ)


def schedule(lost: tuple[int, ...] = ()) -> Any:  # noqa: ANN401
    """Every aid at each second."""
    times = settings.schedule(SECONDS, lost=lost)
    epochs = times["dvl_time_ns"]
    return times | dict.fromkeys(
        (f"{name}_time_ns" for name in ("depth", "heading", "magnetometer", "gps")), epochs
    )


def draw(run: int, lost: tuple[int, ...] = ()) -> dict[str, Any]:
    return bottomlock.simulate_sensors(
        JANUS, motion(), MODEL, schedule(lost), seed=SEED, trajectory_key=5, run=run
    )


@lru_cache(maxsize=1)
def streams() -> dict[str, Array]:
    """All runs, stacked along a first axis."""
    runs = [draw(run) for run in range(RUNS)]
    stacked = {key: np.array([run[key] for run in runs]) for key in runs[0] if key != "initial"}
    stacked["start"] = np.array(
        [
            np.concatenate(
                [
                    run["initial"]["position_t_m"],
                    run["initial"]["attitude_t_p"],
                    run["initial"]["velocity_p_mps"],
                ]
            )
            for run in runs
        ]
    )
    return stacked


def test_imu_white_noise() -> None:
    """A density n per root second sampled at rate f has the sigma n √f, and neighbours are uncorrelated."""
    s, t = streams(), motion()
    for reading, ideal, bias, density in (
        ("imu_force_p_mps2", "force_p_mps2", "accel_bias_p_mps2", MODEL["imu"]["accel_noise_mps_rts"]),
        ("imu_omega_p_radps", "omega_p_radps", "gyro_bias_p_radps", MODEL["imu"]["gyro_noise_rad_rts"]),
    ):
        noise = s[reading] - t[ideal] - s[bias]
        chi_squared_fits(noise, density * np.sqrt(RATE_HZ))
        neighbours = np.corrcoef(noise[:, 1:].ravel(), noise[:, :-1].ravel())[0, 1]
        assert abs(neighbours) < 3.3 / np.sqrt(noise.size)


def test_imu_biases_and_their_walk() -> None:
    """Drawn per run and axis; then the variance grows by walk² per second, in uncorrelated steps."""
    s, imu = streams(), MODEL["imu"]
    for key, sd, walk in (
        ("accel_bias_p_mps2", imu["accel_bias_sd_mps2"], imu["accel_bias_walk_mps2_rts"]),
        ("gyro_bias_p_radps", imu["gyro_bias_sd_radps"], imu["gyro_bias_walk_radps_rts"]),
    ):
        chi_squared_fits(s[key][:, 0], sd)
        for seconds in (5, SECONDS):
            grown = s[key][:, int(seconds * RATE_HZ)] - s[key][:, 0]
            chi_squared_fits(grown, walk * np.sqrt(seconds))
        chi_squared_fits(np.diff(s[key], axis=1), walk / np.sqrt(RATE_HZ))


def test_beam_noise_biases_and_scale_factor() -> None:
    """Eq. 15 taken apart: what is left after the true velocity, bias and scale factor is white noise of one sigma."""
    s, dvl = streams(), MODEL["dvl"]
    velocity = motion()["velocity_p_mps"][int(RATE_HZ) :: int(RATE_HZ)]
    along = velocity @ beams.x_janus().T
    scale = s["dvl_scale_factor"]
    noise = s["dvl_velocity_mps"] - (1 + scale[:, :, None]) * along - s["dvl_bias_mps"]
    chi_squared_fits(noise, dvl["beam_noise_sd_mps"])
    # At the first epoch a second of walk has been added to what was drawn.
    chi_squared_fits(
        s["dvl_bias_mps"][:, 0], np.hypot(dvl["beam_bias_sd_mps"], dvl["beam_bias_walk_mps_rts"])
    )
    chi_squared_fits(scale[:, 0], np.hypot(dvl["scale_factor_sd"], dvl["scale_factor_walk_rts"]))
    chi_squared_fits(np.diff(s["dvl_bias_mps"], axis=1), dvl["beam_bias_walk_mps_rts"])
    chi_squared_fits(np.diff(scale, axis=1), dvl["scale_factor_walk_rts"])
    grown = s["dvl_bias_mps"][:, -1] - s["dvl_bias_mps"][:, 0]
    chi_squared_fits(grown, dvl["beam_bias_walk_mps_rts"] * np.sqrt(SECONDS - 1))


def test_depth_magnetometer_and_gps() -> None:
    """The other aids, each against its own sigma; attitude errors as rotation vectors about north, east, down."""
    s, t = streams(), motion()
    every = slice(int(RATE_HZ), None, int(RATE_HZ))
    chi_squared_fits(s["depth_m"] - t["position_t_m"][every, 2], MODEL["depth"]["sd_m"])
    position = s["gps_position_t_m"] - t["position_t_m"][every]
    rotation = np.array([matrix_from_quaternion(q) for q in t["attitude_t_p"][every]])
    off = s["heading_rad"] - np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    chi_squared_fits(np.angle(np.exp(1j * off)), MODEL["heading"]["sd_rad"])
    velocity_t = np.einsum("tij,tj->ti", rotation, t["velocity_p_mps"][every])
    velocity = s["gps_velocity_t_mps"] - velocity_t
    for axis in range(3):
        chi_squared_fits(position[..., axis], float(np.asarray(MODEL["gps"]["position_sd_m"])[axis]))
        chi_squared_fits(velocity[..., axis], float(np.asarray(MODEL["gps"]["velocity_sd_mps"])[axis]))
    errors = np.array(
        [
            [log_rotation(matrix_from_quaternion(q) @ r.T) for q, r in zip(run, rotation, strict=True)]
            for run in s["magnetometer_attitude_t_p"][:100]
        ]
    )
    # Yaw noise of 0.1 rad is not small: its square leaks 0.5 % into the tilt axes, within the band of 2000 samples.
    chi_squared_fits(errors[..., 2], MODEL["magnetometer"]["yaw_sd_rad"])
    chi_squared_fits(errors[..., :2], MODEL["magnetometer"]["roll_pitch_sd_rad"])


def test_initial_errors() -> None:
    """Position, misalignment and velocity at the start, axis by axis, as `initial` names them."""
    start, t = streams()["start"], motion()
    rotation = matrix_from_quaternion(t["attitude_t_p"][0])
    position = start[:, :3] - t["position_t_m"][0]
    tilt = np.array([log_rotation(rotation @ matrix_from_quaternion(q).T) for q in start[:, 3:7]])
    velocity = start[:, 7:] - t["velocity_p_mps"][0]
    for axis in range(3):
        chi_squared_fits(position[:, axis], 2.0)
        chi_squared_fits(tilt[:, axis], (0.01, 0.01, 0.02)[axis])
        chi_squared_fits(velocity[:, axis], 0.05)
