"""A glider's dive with the bottom hidden: what the water's beams with the current by depth are worth, and their sigma.

The recording (`glider_pathfinder`: attitude, bottom track and cells of 2 m, no inertial readings) is not republished.
`tools/recorded_dives.py` makes its tables, and its two nearest cells are screened as `replay` screens them. Errors are
those of the displacement in the pings whose water and bottom are both there, unless stated otherwise; windows begin
every 150 s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock.config.water_cells import WaterCells
from bottomlock.io.water_table import WaterTable, read_water_table, water_file
from bottomlock.kernel import BeamGeometry, models, replay_log
from bottomlock.kernel.attitude_motion import divided, held, inertial_readings
from bottomlock.recordings.streams import WaterBeams
from bottomlock.recordings.water_cells import water_beams
from bottomlock.replay.vehicle_motion import vehicle_motion
from tools.recorded_dives import glider

Floats = NDArray[np.float64]

BEAM_ANGLE = np.radians(30.0)
PING_S, FIRST, EVERY = 3.0, 233, 50
MOUNTING_PITCH = np.radians(-27.1)
"""Of the DVL: with it the velocities change the depth as the depth sensor says; the instrument left it out."""
JANUS = BeamGeometry.from_angles(
    [BEAM_ANGLE] * 4,
    np.radians([45.0, 225.0, 315.0, 135.0]),
    mounting_rpy_rad=[0.0, MOUNTING_PITCH, 0.0],
)
TO_VELOCITY = np.linalg.pinv(np.asarray(JANUS.directions_p))
CELLS = WaterCells(cells=(1, 2), max_closure_mps=0.035)
BOTTOM_SD_MPS, WATER_SD_MPS = 0.03, 0.05
BY_DEPTH, ONE_CURRENT = models.CurrentLayers(), models.CurrentLayers(sd_mps=0.0)
LATITUDE = np.radians(41.6)


def known(velocity_mps: Floats) -> NDArray[np.bool_]:
    """(n,) whether all components are there."""
    return np.asarray(np.isfinite(velocity_mps).all(axis=-1))


class Dive(NamedTuple):
    """Pings (n,): times, attitudes, depth, beams of the bottom, the velocity they make and the range of side lobes.

    The water is screened, and `table` has all cells.
    """

    time_ns: NDArray[np.int64]
    attitude: Rotation
    depth_m: Floats
    beams_mps: Floats
    velocity_p_mps: Floats
    water: WaterBeams
    table: WaterTable
    range_m: Floats

    @property
    def ned_mps(self) -> Floats:
        """(n, 3) velocity over ground; NaN where the bottom is lost."""
        turned: Floats = self.attitude.apply(np.nan_to_num(self.velocity_p_mps))
        return np.where(known(self.velocity_p_mps)[:, None], turned, np.nan)

    @property
    def water_ned_mps(self) -> Floats:
        """(n, 3) velocity through the screened water; NaN where it is not determined."""
        whole = self.water.valid.all(axis=1)
        at = np.searchsorted(self.time_ns, self.water.time_ns[whole])
        found = np.full((len(self.time_ns), 3), np.nan)
        found[at] = self.attitude[at].apply(self.water.velocity_mps[whole] @ TO_VELOCITY.T)
        return found


@pytest.fixture(scope="module")
def dive(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Dive:
    if not (recordings / "glider_pathfinder" / "pd0_apr10.csv").exists():
        pytest.skip("the glider's recording is not there")
    folder = tmp_path_factory.mktemp("glider")
    glider(recordings, folder)

    def table(name: str, *columns: str) -> Floats:
        found: Floats = (
            pl.read_csv(folder / f"{name}.csv", infer_schema_length=None).select(columns).to_numpy()
        )
        return found.astype(np.float64)

    bottom = table(
        "dvl_beams", "time", *(f"beam{k}_{what}" for what in ("mps", "range_m") for k in range(1, 5))
    )
    time_s, beams, ranges = bottom[:, 0], bottom[:, 1:5], bottom[:, 5:]
    attitude = table("attitude", "time", "roll", "pitch", "heading")
    # As the table's velocities were turned: by the attitude before each ping.
    rows = np.searchsorted(attitude[:, 0], time_s, side="right") - 1
    depth = table("depth", "time", "depth")
    time_ns = np.round(time_s * 1e9).astype(np.int64)
    cells, noise = read_water_table(water_file(folder / "dvl_beams.csv")), np.full(4, WATER_SD_MPS)
    water, _ = water_beams(cells, JANUS, CELLS, beam_sd_mps=noise, bottom=(time_ns, ranges))
    return Dive(
        time_ns,
        Rotation.from_euler("ZYX", np.radians(attitude[rows, :0:-1])),
        np.interp(time_s, depth[:, 0], depth[:, 1]),
        beams,
        beams @ TO_VELOCITY.T,
        water,
        cells,
        ranges.min(axis=1) * np.cos(BEAM_ANGLE),
    )


class Errors(NamedTuple):
    """Of the displacement: with water, m; of all pings with a bottom, m, and over its sigma."""

    error_m: float
    of_all_m: float
    over_sd: float


def hidden(dive: Dive, first: int, last: int, *, water: bool, layers: models.CurrentLayers) -> Errors:
    """Those of `tc` over the pings from `first` to `last` without the bottom."""
    has_bottom = known(dive.velocity_p_mps)
    pings = slice(0, last)
    seen = has_bottom[pings].copy()
    seen[first:] = False
    velocity_p = dive.velocity_p_mps
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
        "dvl_time_ns": dive.time_ns[pings], "beam_velocity_mps": np.nan_to_num(dive.beams_mps[pings]),
        "beam_valid": np.repeat(seen[:, None], 4, axis=1),
        "depth_time_ns": dive.time_ns[pings], "depth_m": dive.depth_m[pings],
    }  # fmt: skip
    if water:
        wet = slice(0, np.searchsorted(dive.water.time_ns, dive.time_ns[last]))
        log |= {
            "water_track_time_ns": dive.water.time_ns[wet], "water_track_valid": dive.water.valid[wet],
            "water_track_velocity_mps": np.nan_to_num(dive.water.velocity_mps[wet]),
            "water_track_sd_mps": dive.water.sd_mps[wet], "water_track_range_m": dive.water.range_m[wet],
        }  # fmt: skip
    start = models.InitialState(
        time_ns=int(dive.time_ns[0]), position_t_m=(0.0, 0.0, dive.depth_m[0]),
        attitude_t_p=attitude[0].as_quat(scalar_first=True), velocity_p_mps=velocity_p[rows[0]],
    )  # fmt: skip
    samples = dive.time_ns[first - 1 : last]
    out: Any = replay_log(JANUS, model, options, ["tc"], log, start, sample_time_ns=samples, covariances=True)
    turned = Rotation.from_quat(out["attitude_t_p"][0], scalar_first=True)
    faster = turned.apply(out["velocity_p_mps"][0])[1:, :2] - dive.ned_mps[first:last, :2]
    before, after = out["covariance"][0][[0, -1]][:, :2, :2]
    seen_again = has_bottom[first:last]
    with_water, of_all = (
        float(np.hypot(*(faster[counted].sum(axis=0) * PING_S)))
        for counted in (seen_again & known(dive.water_ned_mps)[first:last], seen_again)
    )
    return Errors(with_water, of_all, of_all / float(np.sqrt(np.trace(after - before))))


def windows(dive: Dive, seconds: float) -> list[tuple[int, int]]:
    """First ping of each window in half of which the bottom is known, and the first after it."""
    length, has_bottom = round(seconds / PING_S), known(dive.velocity_p_mps)
    firsts = range(FIRST, len(dive.time_ns) - length, EVERY)
    return [(first, first + length) for first in firsts if has_bottom[first : first + length].mean() >= 0.5]


def errors(
    dive: Dive, seconds: float, *, water: bool = True, layers: models.CurrentLayers = BY_DEPTH
) -> Floats:
    """(w, 3) `Errors` of every window."""
    return np.array([hidden(dive, *one, water=water, layers=layers) for one in windows(dive, seconds)])


def table_errors(dive: Dive, seconds: float) -> Floats:
    """(w,) errors with water, m, with the mean current within 2 m of depth in the half hour before."""
    water = dive.water_ned_mps[:, :2]
    current = dive.ned_mps[:, :2] - water
    both, found = known(current), []
    for first, last in windows(dive, seconds):
        begin = np.searchsorted(dive.time_ns, dive.time_ns[first] - 1_800_000_000_000)
        lock = begin + np.flatnonzero(both[begin:first])
        total = np.zeros(2)
        for ping in first + np.flatnonzero(both[first:last]):
            apart = np.abs(dive.depth_m[lock] - dive.depth_m[ping])
            near = lock[apart <= max(2.0, apart.min() + 0.01)]
            total += current[near].mean(axis=0) - current[ping]
        found.append(np.hypot(*total) * PING_S)
    return np.array(found)


def test_the_depth_changes_as_the_mounting_says(dive: Dive) -> None:
    """Seen: 0.051 m/s RMS of a depth rate of 0.102 and no mean; 0.164 and 0.146 m/s without the mounting."""

    def misfit(pitch: float) -> Floats:
        turned = (dive.attitude * Rotation.from_euler("Y", pitch)).apply(np.nan_to_num(dive.velocity_p_mps))[
            :, 2
        ]
        down = np.where(known(dive.velocity_p_mps), turned, np.nan)
        time_s = (dive.time_ns - dive.time_ns[0]) * 1e-9
        rate = (dive.depth_m[4:] - dive.depth_m[:-4]) / (time_s[4:] - time_s[:-4])
        found: Floats = rate - down[2:-2]
        return found[np.isfinite(found) & (dive.depth_m[2:-2] > 1.0)]

    with_it, without = misfit(0.0), misfit(-MOUNTING_PITCH)
    assert abs(with_it.mean()) < 0.005
    assert np.sqrt(np.mean(with_it**2)) < 0.06
    assert without.mean() > 0.1


def test_side_lobes_slow_the_water_near_the_bottom(dive: Dive) -> None:
    """A lobe straight down sees no motion. Of the speed it shows 0.52 to 2 m of range, 0.69 at 3 m, 1.01 from 7 m."""
    first = dive.table.cell == 1
    good = dive.table.valid[first].all(axis=1) & known(dive.velocity_p_mps)
    ahead = (dive.table.velocity_mps[first] @ TO_VELOCITY.T)[:, 0], dive.velocity_p_mps[:, 0]

    def part(least_m: float, most_m: float) -> float:
        rows = good & (dive.range_m >= least_m) & (dive.range_m < most_m) & (dive.depth_m > 1.0)
        water, bottom = (one[rows] for one in ahead)
        return float(water @ bottom / (bottom @ bottom))

    assert part(0.0, 2.0) < 0.6
    assert part(3.0, 4.0) < 0.8
    assert 0.97 < part(7.0, 14.0) < 1.03


@pytest.mark.long
@pytest.mark.parametrize(
    ("seconds", "median_m", "most_m"), [(60.0, 1.4, 2.6), (300.0, 4.3, 8.0), (600.0, 7.4, 12.0)]
)
def test_minutes_without_the_bottom(dive: Dive, seconds: float, median_m: float, most_m: float) -> None:
    """Seen: 0.8 m (90 %: 2.1 m), 2.4 (6.0) and 4.8 (9.3) after 60, 300 and 600 s.

    Of all pings, with a fifth of them without water: 1.3 m (3.2 m), 6.9 (13.0), 11.2 (22.8); sigma is of these.

    A plain table of the current by depth has 0.7 (2.3), 2.4 (5.4) and 5.4 (10.0); the filter without water 3.6, 12.4
    and 20.1 m. The bounds hold for each half of the dive.
    """
    found = errors(dive, seconds)
    error_m, _, over_sd = found.T
    for part in (error_m, *np.array_split(error_m, 2)):
        assert np.median(part) < median_m
        assert np.quantile(part, 0.9) < most_m
    assert 0.5 < np.sqrt(np.mean(over_sd**2)) < 1.4
    table = table_errors(dive, seconds)
    assert np.median(error_m) < 1.2 * np.median(table)
    assert np.quantile(error_m, 0.9) < 1.2 * np.quantile(table, 0.9)
    without = errors(dive, seconds, water=False)
    assert np.median(error_m) < 0.3 * np.median(without[:, 0])


@pytest.mark.long
def test_the_current_by_depth_halves_the_error(dive: Dive) -> None:
    """Seen after 600 s: 4.8 m by depth, 15.3 m with one current of 0.3 m/s and half an hour."""
    by_depth, one = (errors(dive, 600.0, layers=layers)[:, 0] for layers in (BY_DEPTH, ONE_CURRENT))
    assert np.median(by_depth) < 0.6 * np.median(one)
