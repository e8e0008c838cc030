"""A glider's dive with the bottom hidden: what the water's beams with the current by depth are worth, and their sigma.

The recording (`glider_pathfinder`: attitude, bottom track and cells of 2 m, no inertial readings) is not republished.
The two nearest cells, left out where the four beams disagree (error velocity over 0.05 m/s); everything else as
`replay` has it for a vehicle without an IMU. Errors are those of the velocity summed over the pings whose water and
bottom are both there; windows begin every 150 s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.kernel import make_geometry, models, replay_log
from bottomlock.kernel.attitude_motion import divided, held, inertial_readings
from bottomlock.replay.vehicle_motion import vehicle_motion

Floats = NDArray[np.float64]

PING_S, FIRST, EVERY = 3.0, 233, 50
CELLS, FIRST_CELL_M, CELL_M, DISAGREE_MPS = 2, 2.93, 2.0, 0.05
BEAM_ANGLE = np.radians(30.0)
JANUS = make_geometry("x", tilt_rad=BEAM_ANGLE)
BOTTOM_SD_MPS, WATER_SD_MPS = 0.03, 0.05
BY_DEPTH, ONE_CURRENT = models.CurrentLayers(), models.CurrentLayers(sd_mps=0.0)
LATITUDE = np.radians(41.6)


def known(velocity_mps: Floats) -> NDArray[np.bool_]:
    """(n,) whether all components are there."""
    return np.asarray(np.isfinite(velocity_mps).all(axis=-1))


class Dive(NamedTuple):
    """Pings (n,): times, attitudes, depth, and what bottom and water say, east, north, up and error; NaN where lost."""

    time_ns: NDArray[np.int64]
    attitude: Rotation
    depth_m: Floats
    bottom_mps: Floats
    water_mps: Floats
    range_m: Floats

    def beams(self, velocity_enu_mps: Floats) -> Floats:
        """(n, 4) beams of (n, 3) velocities, 0 where they are lost."""
        ned = np.nan_to_num(velocity_enu_mps[:, [1, 0, 2]] * [1.0, 1.0, -1.0])
        turned: Floats = self.attitude.inv().apply(ned)
        return turned @ np.asarray(JANUS.directions_p).T


@pytest.fixture(scope="module")
def dive(recordings: Path) -> Dive:
    path = recordings / "glider_pathfinder" / "pd0_apr10.csv"
    if not path.exists():
        pytest.skip("the glider's recording is not there")
    log = pl.read_csv(path, infer_schema_length=5000)

    def column(name: str) -> Floats:
        found: Floats = log[name].to_numpy().astype(np.float64)
        return found

    def four(name: str) -> Floats:
        return -np.stack([column(name.format(beam)) for beam in range(4)], axis=1)

    cells = np.stack([four(f"vel_bin{cell}_beam{{}}") for cell in range(CELLS)], axis=1)
    good = known(cells) & (np.abs(cells[:, :, 3]) < DISAGREE_MPS)
    weight = good / np.maximum(good.sum(axis=1, keepdims=True), 1)
    mean = (np.nan_to_num(cells) * weight[:, :, None]).sum(axis=1)
    below_m = (weight * (FIRST_CELL_M + CELL_M * np.arange(CELLS))).sum(axis=1)
    angles = np.radians(np.stack([column(name) for name in ("heading", "pitch", "roll")], axis=1))
    return Dive(
        np.round((column("time") - column("time")[0]) * 1e9).astype(np.int64),
        Rotation.from_euler("ZYX", angles),
        column("depth"),
        four("btm_beam{}_velocity")[:, :3],
        np.where(good.any(axis=1, keepdims=True), mean[:, :3], np.nan),
        below_m / np.cos(BEAM_ANGLE),
    )


def hidden(
    dive: Dive, first: int, last: int, *, water: bool, layers: models.CurrentLayers
) -> tuple[float, float]:
    """Error of `tc` over the pings from `first` to `last` without the bottom, m, and the same over its sigma."""
    has_bottom = known(dive.bottom_mps)
    pings = slice(0, last)
    seen = has_bottom[pings].copy()
    seen[first:] = False
    beams = dive.beams(dive.bottom_mps)
    velocity_p = beams @ np.linalg.pinv(np.asarray(JANUS.directions_p)).T
    motion = vehicle_motion(dive.time_ns[has_bottom], velocity_p[has_bottom])
    imu_ns, attitude = divided(dive.time_ns[pings], dive.attitude[pings])
    rows = np.flatnonzero(seen)
    persists = held(imu_ns, dive.time_ns[rows], velocity_p[rows])
    omega, force = inertial_readings(imu_ns, attitude, persists, latitude_rad=LATITUDE)
    change = np.sqrt(2.0 * motion.fluctuation_sd_mps**2 / motion.fluctuation_time_s)
    model = models.Model(
        environment=models.Environment(latitude_rad=LATITUDE, gravity_mps2=0.0),
        imu=models.ImuModel(
            accel_noise_mps_rts=5.0 * float(np.sqrt(np.mean(change[:2] ** 2))),
            gyro_noise_rad_rts=1e-6,
            accel_bias_sd_mps2=1e-6,
            gyro_bias_sd_radps=1e-7,
            accel_bias_walk_mps2_rts=0.0,
            gyro_bias_walk_radps_rts=0.0,
        ),
        initial=models.InitialModel(
            position_sd_m=(0.01,) * 3, attitude_sd_rad=(1e-3,) * 3, velocity_sd_mps=(0.3,) * 3
        ),
        dvl=models.DvlModel(
            beam_noise_sd_mps=BOTTOM_SD_MPS, beam_bias_sd_mps=1e-6, beam_bias_walk_mps_rts=0.0,
            scale_factor_sd=1e-6, scale_factor_walk_rts=0.0,
        ),
        depth=models.DepthModel(sd_m=0.1, bias_sd_m=0.0, bias_time_s=1e3),
    )  # fmt: skip
    options = models.Options(
        water_track=water, current_layers=layers, motion=motion.prior, estimate_dvl=False,
        imu_sampling="averaged", max_imu_gap_s=100.0, imu_gap="inflate",
    )  # fmt: skip
    log: Any = {
        "imu_time_ns": imu_ns, "force_p_mps2": force, "omega_p_radps": omega,
        "dvl_time_ns": dive.time_ns[pings], "beam_velocity_mps": beams[pings],
        "beam_valid": np.repeat(seen[:, None], 4, axis=1),
        "depth_time_ns": dive.time_ns[pings], "depth_m": dive.depth_m[pings],
    }  # fmt: skip
    if water:
        wet = np.flatnonzero(known(dive.water_mps[pings]))
        log |= {
            "water_track_time_ns": dive.time_ns[wet], "water_track_velocity_mps": dive.beams(dive.water_mps)[wet],
            "water_track_valid": np.ones((len(wet), 4), dtype=bool),
            "water_track_sd_mps": np.full((len(wet), 4), WATER_SD_MPS), "water_track_range_m": dive.range_m[wet],
        }  # fmt: skip
    start = models.InitialState(
        time_ns=0, position_t_m=(0.0, 0.0, dive.depth_m[0]),
        attitude_t_p=attitude[0].as_quat(scalar_first=True), velocity_p_mps=velocity_p[rows[0]],
    )  # fmt: skip
    samples = dive.time_ns[first - 1 : last]
    out: Any = replay_log(JANUS, model, options, ["tc"], log, start, sample_time_ns=samples, covariances=True)
    turned = Rotation.from_quat(out["attitude_t_p"][0], scalar_first=True)
    faster = turned.apply(out["velocity_p_mps"][0])[1:, :2] - dive.bottom_mps[first:last, [1, 0]]
    counted = (has_bottom & known(dive.water_mps))[first:last]
    error_m = float(np.hypot(*(faster[counted].sum(axis=0) * PING_S)))
    before, after = out["covariance"][0][[0, -1]][:, :2, :2]
    return error_m, error_m / float(np.sqrt(np.trace(after - before)))


def errors(
    dive: Dive, seconds: float, *, water: bool = True, layers: models.CurrentLayers = BY_DEPTH
) -> Floats:
    """(w, 2) errors, m, and over their sigma, of every window in half of which the bottom is known."""
    length = round(seconds / PING_S)
    has_bottom = known(dive.bottom_mps)
    firsts = range(FIRST, len(dive.time_ns) - length, EVERY)
    windows = [
        slice(first, first + length) for first in firsts if has_bottom[first : first + length].mean() >= 0.5
    ]
    return np.array(
        [hidden(dive, window.start, window.stop, water=water, layers=layers) for window in windows]
    )


@pytest.mark.long
@pytest.mark.parametrize(("seconds", "median_m", "most_m"), [(300.0, 6.4, 16.0), (600.0, 12.0, 28.0)])
def test_ten_minutes_without_the_bottom(dive: Dive, seconds: float, median_m: float, most_m: float) -> None:
    """Seen: 4.8 m (90 %: 13.1 m) after 300 s, 10.0 m (23.9 m) after 600 s; without water 49 m and 106 m."""
    found = errors(dive, seconds)
    error_m, over_sd = found.T
    assert np.median(error_m) < median_m
    assert np.quantile(error_m, 0.9) < most_m
    assert 0.5 < np.sqrt(np.mean(over_sd**2)) < 1.4
    without = errors(dive, seconds, water=False)
    assert np.median(error_m) < 0.2 * np.median(without[:, 0])


@pytest.mark.long
def test_the_current_by_depth_halves_the_error(dive: Dive) -> None:
    """Seen after 600 s: 10.0 m by depth, 21.8 m with one current of 0.3 m/s and half an hour."""
    by_depth, one = (errors(dive, 600.0, layers=layers)[:, 0] for layers in (BY_DEPTH, ONE_CURRENT))
    assert np.median(by_depth) < 0.6 * np.median(one)
