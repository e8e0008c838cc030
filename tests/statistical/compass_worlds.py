"""Worlds whose magnetic compass deviates with heading, by two sigma of the deviation that is claimed."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bottomlock import kernel
from bottomlock.config.attitude_reference import AttitudeReference
from bottomlock.config.instrument_grades import imu
from bottomlock.dead_reckoning.sensors import Sensors, reckon
from bottomlock.kernel import Method
from bottomlock.kernel.models import InitialState, MagnetometerModel, Model, Options, Robust
from bottomlock.recordings.streams import Attitudes, Depths
from bottomlock.simulation.build import Simulation
from bottomlock.simulation.measurement_schedule import measurement_schedule
from bottomlock.truth import Truth
from tests.analytic import analytic_simulation
from tests.drawn_log import drawn_log
from tests.oracle.rotations import Array

SEED = 20240611
DEGREE = np.pi / 180.0
SPEED_MPS = 1.5

WHITE = MagnetometerModel(yaw_sd_rad=0.2 * DEGREE, roll_pitch_sd_rad=0.2 * DEGREE)
GRADE = AttitudeReference(grade="mti_ahrs", aids="attitude")
SURPRISED: Any = GRADE.kernel_models()["magnetometer"]
"""The packaged grade, which claims no deviation."""
CLAIMED = SURPRISED.replace(yaw_semicircular_sd_rad=1.5 * DEGREE, yaw_quadrantal_sd_rad=0.75 * DEGREE)


@dataclass(frozen=True)
class World:
    """Mask of the beams, rate of the compass, deviation by cos ψ and by cos 2ψ in degrees, heading of the first leg.

    And its other errors, path, length, and whether the start is its reading, as in a replay.
    """

    beams: tuple[int, ...] = (1, 2, 3, 4)
    attitude_hz: float = 1.0
    semicircular_deg: float = 3.0
    quadrantal_deg: float = 1.5
    heading_deg: float = 0.0
    errors: MagnetometerModel = WHITE
    path: str = "lawn_mower"
    duration_s: float = 600.0
    from_compass: bool = False


WORLDS = {
    "whole, beams 1234, 1 Hz": World(),
    "whole, beams 1234, 5 Hz": World(attitude_hz=5.0),
    "whole, beams 12, 1 Hz": World(beams=(1, 2)),
    "hard iron, beams 1234, 1 Hz": World(quadrantal_deg=0.0),
    "hard iron, beams 12, 1 Hz": World(beams=(1, 2), quadrantal_deg=0.0),
}
"""Those that find out a filter which charges the heading alone; half the deviation, or hard iron at 5 Hz, does not."""


@dataclass(frozen=True)
class Track:
    """At the end: error of the horizontal position and its 1 sigma, m, and its NEES."""

    error_m: float
    sd_m: float
    nees: float


@lru_cache(maxsize=4)
def motion(path: str, duration_s: float, heading_deg: float) -> tuple[Simulation, Truth]:
    """At 1.5 m/s."""
    simulation = analytic_simulation(
        path, imu_hz=50.0, duration_s=duration_s, speed_mps=SPEED_MPS, heading_deg=heading_deg
    )
    return simulation, simulation.truth()


@dataclass(frozen=True)
class Readings:
    """What was read in a run, and the true positions at the times of the pings."""

    simulation: Simulation
    model: Model
    options: Options
    drawn: Any
    start: Any
    position_t_m: Array


def readings(world: World, run: int, claimed: MagnetometerModel = SURPRISED) -> Readings:
    """The readings of a run; a start that is drawn has the errors that it claims, those of the compass."""
    simulation, truth = motion(world.path, world.duration_s, world.heading_deg)
    scenario = simulation.scenario
    model = scenario.kernel_model(simulation.gravity_mps2).replace(imu=imu("tactical"), magnetometer=claimed)
    tilt, turn = float(np.hypot(0.5, 0.5)), float(np.hypot(1.0, 1.7))
    if world.from_compass:
        tilt, turn = GRADE.start_roll_pitch_sd_deg, GRADE.start_yaw_sd_deg
    initial = model.initial.replace(
        attitude_sd_rad=[tilt * DEGREE, tilt * DEGREE, turn * DEGREE], position_sd_m=[0.5] * 3
    )
    model = model.replace(initial=initial)
    schedule: Any = dict(measurement_schedule(simulation, truth))
    pings = schedule["dvl_time_ns"]
    schedule["beam_valid"] = np.tile(np.isin(np.arange(1, 5), world.beams), (len(pings), 1))
    every = round(scenario.imu.rate_hz / world.attitude_hz)
    schedule["magnetometer_time_ns"] = np.ascontiguousarray(truth.time_ns[every::every])
    yaw = yaw_rad(truth.attitude_t_p)
    deviation = DEGREE * (world.semicircular_deg * np.cos(yaw) + world.quadrantal_deg * np.cos(2.0 * yaw))
    schedule["yaw_offset_rad"] = np.ascontiguousarray(deviation[every::every])
    arrays: Any = truth.kernel_arrays()
    options = scenario.kernel_options().replace(inflate_after_rejections=5, robust=Robust())
    drawn: Any = kernel.simulate_sensors(
        simulation.geometry, arrays, model.replace(magnetometer=world.errors), schedule,
        seed=SEED, trajectory_key=61, run=run, imu_sampling=scenario.imu.sampling, options=options,
    )  # fmt: skip
    rows = np.searchsorted(truth.time_ns, drawn["dvl_time_ns"])
    start = dict(drawn["initial"])
    if world.from_compass:
        start["attitude_t_p"] = drawn["magnetometer_attitude_t_p"][0]
    return Readings(simulation, model, options, drawn, start, truth.position_t_m[rows])


def yaw_rad(attitude_t_p: Array) -> Array:
    """Yaw (n,) of quaternions (n, 4)."""
    w, x, y, z = attitude_t_p.T
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def rotation(attitude_t_p: Array) -> Rotation:
    """The rotation of quaternions, scalar first."""
    return Rotation.from_quat(attitude_t_p, scalar_first=True)


def filtered(read: Readings, method: Method, inflate_after_rejections: int) -> Track:
    """The end of a method's track."""
    drawn = read.drawn
    compass = drawn["magnetometer_attitude_t_p"]
    log: Any = drawn_log(drawn) | {"attitude_time_ns": drawn["magnetometer_time_ns"], "attitude_t_p": compass}
    out = kernel.replay_log(
        read.simulation.geometry, read.model,
        read.options.replace(inflate_after_rejections=inflate_after_rejections), [method], log, read.start,
        sample_time_ns=drawn["dvl_time_ns"], covariances=True,
    )  # fmt: skip
    error = out["position_t_m"][0] - read.position_t_m
    cov = np.asarray(out["covariance"])[0, -1, :2, :2]
    return track(error[-1, :2], cov)


def reckoned(read: Readings) -> Track:
    """The end of the track by dead reckoning."""
    drawn = read.drawn
    compass = drawn["magnetometer_time_ns"]
    none = np.zeros(0, dtype=np.int64)
    result = reckon(
        read.simulation.geometry, read.model, InitialState(**read.start),
        Sensors(
            drawn["imu_time_ns"], drawn["imu_omega_p_radps"], drawn["imu_force_p_mps2"], drawn["dvl_time_ns"],
            drawn["dvl_velocity_mps"], drawn["dvl_valid"], Depths(none, np.zeros(0)),
            Attitudes(compass, rotation(drawn["magnetometer_attitude_t_p"])), none, np.zeros(0),
        ),
        drawn["dvl_time_ns"], depth_lever_p_m=np.zeros(3),
    )  # fmt: skip
    error = result.position_t_m - read.position_t_m
    return track(error[-1, :2], result.position_cov_m2[-1, :2, :2])


def track(error_m: Array, cov_m2: Array) -> Track:
    """The end of a track by its error (2,) and covariance (2, 2)."""
    return Track(
        error_m=float(np.linalg.norm(error_m)),
        sd_m=float(np.sqrt(np.trace(cov_m2))),
        nees=float(error_m @ np.linalg.solve(cov_m2, error_m)),
    )
