"""Fish: bursts of valid and wrong beams do not make the filter overconfident.

While rejections of any size counted, five wrong pings got in, and the mean NEES of a velocity component was 7.3 over
the missions with three beams and 29 over the Janus's.
"""

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bottomlock import InitialState, Scenario, Truth, build_simulation, read_geometry, sensor_streams
from bottomlock.io import pd0
from bottomlock.kernel import models
from bottomlock.recordings.closure import closure_rows
from bottomlock.recordings.streams import Inertial
from tests.statistical.missions import Mission, Pings, Scalars, replayed

Floats = NDArray[np.float64]

DURATION_S = 250.0
LOG = Path(__file__).parents[2] / "data" / "logs" / "pd0_riverpro" / "RiverPro_test01.PD0"
IMU = {
    "accel_bias_mg": 0.05, "gyro_bias_deg_per_h": 0.1, "accel_noise_mps_per_rt_h": 0.005,
    "gyro_noise_deg_per_rt_h": 0.005,
}  # fmt: skip
DVL = {
    "beam_bias_mps": 0.002, "beam_bias_walk_mps_per_rt_s": 0.0, "scale_factor_percent": 0.4,
    "scale_factor_walk_percent_per_rt_s": 1e-3, "min_range_m": 0.8, "max_range_m": 104.0, "max_incidence_deg": 60.0,
}  # fmt: skip
THREE_BEAMS = {
    "configuration": "angles", "tilts_deg": [25.0] * 3, "azimuths_deg": [0.0, 120.0, 240.0], "beam_noise_mps": 0.015,
}  # fmt: skip
JANUS = {"configuration": "x", "tilt_deg": 30.0, "beam_noise_mps": 0.020}
POSITION_SD_M, VELOCITY_SD_MPS, ANGLES_SD_DEG = 2.0, 0.02, (0.02, 0.02, 0.1)


@dataclass(frozen=True, eq=False)
class World:
    """What is fixed of a mission; `name` is of its random streams."""

    name: str
    vehicle: str
    speed_mps: tuple[float, float]
    current: dict[str, float]
    dvl: dict[str, Any]
    noise: Literal["gaussian", "recorded"]
    path: Literal["lawn", "zigzag"]


WITH_THREE_BEAMS = World(
    "tauv-fibre_optic-slope-steady-three_beams-fish-recorded-lawn-250s",
    "tauv", (1.8, 2.2), {"speed_mps": 0.3}, THREE_BEAMS, "recorded", "lawn",
)  # fmt: skip
WITH_JANUS = World(
    "remus100-fibre_optic-slope-sheared-janus30-fish-gaussian-zigzag-250s",
    "remus100", (1.8, 2.0),
    {"speed_mps": 0.2, "shear_per_m": 0.006, "wander_sd_mps": 0.03, "wander_time_s": 300.0}, JANUS,
    "gaussian", "zigzag",
)  # fmt: skip


def number(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little")


def stream(seed: int, world: World, purpose: str) -> np.random.Generator:
    """The random numbers of one purpose in one mission; different purposes and missions are independent."""
    return np.random.Generator(
        np.random.Philox(np.random.SeedSequence([seed, number(world.name), number(purpose)]))
    )


def waypoints(world: World, draw: np.random.Generator, reach_m: float) -> list[tuple[float, float]]:
    """North and east, m, of a path of at least this length in a direction that is drawn."""
    length, width = draw.uniform(80.0, 120.0), draw.uniform(40.0, 60.0)
    if world.path == "zigzag":
        count = int(np.ceil(reach_m / length)) + 1
        turn = np.deg2rad(35.0) * np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
        steps = length * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        points = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    else:
        rows = [0, 1, 2, 3, 4, 3, 2, 1]
        count = int(np.ceil(reach_m / length)) + 2
        ends = [[(k % 2) * length, rows[k % 8] * width] for k in range(count)]
        corners = [[ends[k][0], rows[(k - 1) % 8] * width] for k in range(1, count)]
        points = np.array([ends[0], *(pair[k] for k in range(count - 1) for pair in (corners, ends[1:]))])
    heading = draw.uniform(0.0, 2.0 * np.pi)
    cosine, sine = np.cos(heading), np.sin(heading)
    turned = points @ np.array([[cosine, sine], [-sine, cosine]])
    return [(float(north), float(east)) for north, east in turned.round(3)]


def depth_profile(draw: np.random.Generator) -> list[tuple[float, float]]:
    """Depths (m) at times (s): level, then down or up at 0.2 m/s, and so on until the end."""
    time, depth = draw.uniform(20.0, 50.0), draw.uniform(12.0, 20.0)
    knots = [(0.0, depth)]
    while time < DURATION_S:
        other = draw.uniform(12.0, 30.0)
        knots += [(time, depth), (time + max(10.0, abs(other - depth) / 0.2), other)]
        depth, time = other, knots[-1][0] + draw.uniform(30.0, 90.0)
    return [(float(round(at, 2)), float(round(value, 3))) for at, value in knots]


def scenario(world: World, seed: int, **dvl: float) -> Scenario:
    """The mission without fish, with the noise of its data sheet where `dvl` does not state another."""
    draw = stream(seed, world, "path")
    speed = draw.uniform(*world.speed_mps)
    path = waypoints(world, draw, speed * DURATION_S + 100.0)
    profile = depth_profile(draw)
    draw = stream(seed, world, "current")
    towards, sheared = draw.uniform(0.0, 360.0), draw.uniform(0.0, 2.0 * np.pi)
    current, shear = dict(world.current), world.current.get("shear_per_m", 0.0)
    current.pop("shear_per_m", None)
    downhill = stream(seed, world, "seabed").uniform(0.0, 2.0 * np.pi)
    roll, pitch, yaw = ANGLES_SD_DEG
    return Scenario.model_validate({
        "name": world.name,
        "environment": {"earth": "tangent_plane"},
        "trajectory": {
            "kind": "waypoints", "source": "vehicle", "vehicle": world.vehicle, "duration_s": DURATION_S,
            "speed_mps": speed,
        },
        "mission": {
            "waypoints_m": path, "turn_radius_m": 12.0, "depth_profile": profile,
            "current": current | {
                "towards_deg": towards,
                "shear_north_mps_per_m": shear * float(np.cos(sheared)),
                "shear_east_mps_per_m": shear * float(np.sin(sheared)),
                "seed": int(draw.integers(2**31)),
            },
        },
        "seabed": {
            "kind": "plane", "depth_m": 85.0, "slope_north_deg": 5.0 * float(np.cos(downhill)),
            "slope_east_deg": 5.0 * float(np.sin(downhill)),
        },
        "imu": {"rate_hz": 100.0, "sampling": "averaged"} | IMU,
        "dvl": DVL | world.dvl | dvl,
        "depth": {"rate_hz": 1.0},
        "heading": {"rate_hz": 1.0, "noise_deg": 0.5},
        "initial": {
            "position_m": [POSITION_SD_M] * 3, "velocity_mps": [VELOCITY_SD_MPS] * 3,
            "roll_deg": roll, "pitch_deg": pitch, "yaw_deg": yaw,
        },
        "campaign": {"seed": number(f"{seed} {world.name}") & (2**63 - 1)},
    })  # fmt: skip


def noise(world: World, shape: tuple[int, int], draw: np.random.Generator) -> Floats:
    """Noise (n, B), m/s, of which 68.3 % lie within that of the data sheet: Gaussian, or as a river profiler has it."""
    sd_mps = world.dvl["beam_noise_mps"]
    if world.noise == "gaussian":
        return np.asarray(sd_mps * draw.standard_normal(shape))
    beams = pd0.FORMAT.read(LOG.read_bytes(), LOG.name).table
    rows = closure_rows(read_geometry("teledyne_20").geometry.directions_p)
    residuals = (beams.velocity_mps[beams.valid.all(axis=1)] @ rows.T).ravel()
    residuals -= np.median(residuals)
    relative = np.round(residuals / np.quantile(np.abs(residuals), 0.683), 4)
    return np.asarray(sd_mps * draw.choice(relative, shape))


def shoals(
    time_ns: NDArray[np.int64], directions_p: Floats, draw: np.random.Generator
) -> tuple[Floats, NDArray[np.bool_]]:
    """Errors (n, B), m/s, and validity (n, B) of beams that meet fish which swim horizontally.

    Every 40 s in the mean, for 4 s in the mean, at 0.3 to 1.5 m/s. A beam whose target has the velocity u reads
    b · (v - u), so that its error is -b · u. In 3 of 10 bursts the next beam meets it too, in 3 of 10 the others are
    lost.
    """
    beams = len(directions_p)
    time_s = (time_ns - time_ns[0]) * 1e-9
    error, valid = np.zeros((len(time_s), beams)), np.ones((len(time_s), beams), dtype=np.bool_)
    at = draw.exponential(40.0)
    while at < time_s[-1]:
        end = at + draw.exponential(4.0)
        within = (time_s >= at) & (time_s < end)
        speed, course = draw.uniform(0.3, 1.5), draw.uniform(0.0, 2.0 * np.pi)
        swims = speed * np.array([np.cos(course), np.sin(course), 0.0])
        first = int(draw.integers(beams))
        met = [first, (first + 1) % beams] if draw.random() < 0.3 else [first]
        others = [beam for beam in range(beams) if beam not in met]
        lost = draw.random() < 0.3
        for beam in met:
            error[within, beam] -= directions_p[beam] @ swims
        for beam in others if lost else ():
            valid[within, beam] = False
        at = end + draw.exponential(40.0)
    return error, valid


def initial_state(world: World, seed: int, truth: Truth) -> InitialState:
    """The true state with errors of the claimed standard deviations."""
    draw = stream(seed, world, "start")
    turned = Rotation.from_rotvec(draw.standard_normal(3) * np.deg2rad(ANGLES_SD_DEG))
    attitude = turned * Rotation.from_quat(truth.attitude_t_p[0], scalar_first=True)
    return InitialState(
        time_ns=int(truth.time_ns[0]),
        position_t_m=truth.position_t_m[0] + draw.standard_normal(3) * POSITION_SD_M,
        velocity_p_mps=truth.velocity_p_mps[0] + draw.standard_normal(3) * VELOCITY_SD_MPS,
        attitude_t_p=attitude.as_quat(scalar_first=True),
    )


@lru_cache(maxsize=8)
def mission(world: World, seed: int) -> tuple[Mission, Floats]:
    """The mission and the true velocity in platform axes (n, 3) at the times of its grid."""
    stated = scenario(world, seed)
    simulation = build_simulation(scenario(world, seed, beam_noise_mps=1e-9))
    truth = simulation.truth()
    streams = sensor_streams(simulation, truth)
    imu, beams = streams["imu"], streams["beams"]
    count, time_ns = simulation.geometry.beams, beams["time_ns"].to_numpy()
    velocity = beams.select(f"beam{k + 1}_mps" for k in range(count)).fill_null(np.nan).to_numpy()
    velocity += noise(world, velocity.shape, stream(seed, world, "noise"))
    error, valid = shoals(time_ns, np.asarray(simulation.geometry.directions_p), stream(seed, world, "beams"))
    valid &= beams.select(f"beam{k + 1}_valid" for k in range(count)).to_numpy()
    rows = np.flatnonzero((truth.time_ns - truth.time_ns[0]) % 1_000_000_000 == 0)[1:]
    flown = Mission(
        geometry=simulation.geometry,
        model=stated.kernel_model(simulation.gravity_mps2),
        options=models.Options(imu_sampling="averaged"),
        start=initial_state(world, seed, truth),
        imu=Inertial(
            imu["time_ns"].to_numpy(),
            imu.select(f"force_{axis}_mps2" for axis in "xyz").to_numpy(),
            imu.select(f"omega_{axis}_radps" for axis in "xyz").to_numpy(),
        ),
        pings=Pings(time_ns, np.where(valid, velocity + error, 0.0), valid),
        depth=Scalars(*(streams["depth"][name].to_numpy() for name in ("time_ns", "depth_m"))),
        heading=Scalars(*(streams["heading"][name].to_numpy() for name in ("time_ns", "heading_rad"))),
        grid_ns=truth.time_ns[rows],
    )
    return flown, truth.velocity_p_mps[rows]


pytestmark = [pytest.mark.statistical, pytest.mark.slow]

JANUS_SEED = 12
"""Of a mission where fish cross two beams whose errors the closure does not see, while the other two are right."""


def velocity_nees(world: World, seed: int, method: str) -> float:
    """The mean NEES of a component over the mission."""
    flown, true_velocity_p_mps = mission(world, seed)
    estimates = replayed(flown, method)
    error = estimates.velocity_p_mps - true_velocity_p_mps
    whitened = np.linalg.solve(estimates.velocity_cov, error[..., None])[..., 0]
    return float(np.einsum("ni,ni->n", error, whitened).mean() / 3.0)


@pytest.mark.parametrize(
    ("method", "missions"),
    [
        ("tc", 2),
        pytest.param("tc", 5, marks=pytest.mark.long),
        pytest.param("sway_current", 5, marks=pytest.mark.long),
    ],
)
def test_three_beams_are_not_overconfident(method: str, missions: int) -> None:
    """Only its size shows a wrong beam of three: with smaller errors the mean may exceed 1 by a half."""
    each = [velocity_nees(WITH_THREE_BEAMS, seed, method) for seed in range(1, missions + 1)]
    assert 0.5 < np.mean(each) < 1.5, each
    assert max(each) < 3.0, each


def test_two_beams_that_agree_do_not_overrule_two_that_agree_with_the_filter() -> None:
    assert 0.5 < velocity_nees(WITH_JANUS, JANUS_SEED, "tc") < 1.5
