"""Windows of a glider's dive as missions: bottom hidden, two nearest cells, attitude, depth; no inertial sensor.

The recording (`glider_pathfinder`) is not republished. The cells are left out where the four beams disagree (error
velocity over 0.05 m/s); everything else is as `replay` has it for a vehicle without an IMU. Errors are those of the
velocity summed over the pings whose water and bottom are both there; windows begin every 150 s.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.kernel import make_geometry, models
from bottomlock.kernel.attitude_motion import divided, held, inertial_readings
from bottomlock.recordings.streams import Inertial, WaterBeams
from bottomlock.replay.vehicle_motion import vehicle_motion
from partialdvl_bench.mission import Estimates, Mission, Pings, Scalars, Start

Floats = NDArray[np.float64]

PING_S, FIRST, EVERY = 3.0, 233, 50
CELLS, FIRST_CELL_M, CELL_M, DISAGREE_MPS = 2, 2.93, 2.0, 0.05
BEAM_ANGLE = np.radians(30.0)
JANUS = make_geometry("x", tilt_rad=BEAM_ANGLE)
BOTTOM_SD_MPS, WATER_SD_MPS = 0.03, 0.05
BY_DEPTH = models.CurrentLayers()
LATITUDE = np.radians(41.6)
RECORDING = Path("glider_pathfinder") / "pd0_apr10.csv"


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


def read_dive(path: Path) -> Dive:
    """The dive from its table."""
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


def windows(dive: Dive, seconds: float) -> Iterator[tuple[int, int]]:
    """First ping and the one after the last of every window in half of which the bottom is known."""
    length = round(seconds / PING_S)
    has_bottom = known(dive.bottom_mps)
    for first in range(FIRST, len(dive.time_ns) - length, EVERY):
        if has_bottom[first : first + length].mean() >= 0.5:
            yield first, first + length


def mission_of_window(
    dive: Dive,
    first: int,
    last: int,
    *,
    water: bool,
    layers: models.CurrentLayers = BY_DEPTH,
    begin: int = 0,
) -> Mission:
    """The dive up to the ping before `last`, the bottom hidden from ping `first` on, asked from the ping before it.

    It begins with ping `begin`.
    """
    has_bottom = known(dive.bottom_mps)
    pings = slice(begin, last)
    seen = has_bottom[pings].copy()
    seen[first - begin :] = False
    beams, time_ns = dive.beams(dive.bottom_mps), dive.time_ns[pings]
    velocity_p = beams @ np.linalg.pinv(np.asarray(JANUS.directions_p)).T
    motion = vehicle_motion(dive.time_ns[has_bottom], velocity_p[has_bottom])
    imu_ns, attitude = divided(time_ns, dive.attitude[pings])
    rows = np.flatnonzero(seen)
    persists = held(imu_ns, time_ns[rows], velocity_p[pings][rows])
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
    wet = begin + np.flatnonzero(known(dive.water_mps[pings]))
    returned = WaterBeams(
        dive.time_ns[wet], dive.beams(dive.water_mps)[wet], np.ones((len(wet), 4), dtype=np.bool_),
        np.full((len(wet), 4), WATER_SD_MPS), dive.range_m[wet],
    )  # fmt: skip
    return Mission(
        name=f"glider-{first}-{last}",
        split="none",
        geometry=JANUS,
        model=model,
        options=options,
        start=Start(
            time_ns=int(time_ns[0]),
            position_t_m=np.array([0.0, 0.0, dive.depth_m[begin]]),
            velocity_p_mps=velocity_p[pings][rows[0]],
            attitude_t_p=attitude[0].as_quat(scalar_first=True),
        ),
        imu=Inertial(imu_ns, force, omega),
        pings=Pings(time_ns, beams[pings], np.repeat(seen[:, None], 4, axis=1)),
        depth=Scalars(time_ns, dive.depth_m[pings]),
        heading=Scalars(np.empty(0, dtype=np.int64), np.empty(0)),
        grid_ns=dive.time_ns[first - 1 : last],
        truth=None,
        water=returned if water else None,
    )


def error_of_window(dive: Dive, first: int, last: int, estimates: Estimates) -> tuple[float, float]:
    """Horizontal error gathered in the window, m, and the same over its sigma; NaN where none is claimed."""
    assert estimates.attitude_t_p is not None
    turned = Rotation.from_quat(estimates.attitude_t_p, scalar_first=True)
    faster = turned.apply(estimates.velocity_p_mps)[1:, :2] - dive.bottom_mps[first:last, [1, 0]]
    counted = (known(dive.bottom_mps) & known(dive.water_mps))[first:last]
    error_m = float(np.hypot(*(faster[counted].sum(axis=0) * PING_S)))
    if estimates.position_cov is None:
        return error_m, float("nan")
    before, after = estimates.position_cov[[0, -1]][:, :2, :2]
    return error_m, error_m / float(np.sqrt(np.trace(after - before)))
