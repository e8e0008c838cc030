"""Readings of a mission with the claimed errors of its sensors, and what one of our methods estimates from them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bottomlock import BeamGeometry, InitialState, Model, Options, replay_log
from bottomlock.recordings.streams import Inertial, WaterBeams

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

POSITION, VELOCITY = slice(0, 3), slice(6, 9)
"""Error states of position and velocity in the kernel's covariance."""


@dataclass(frozen=True, eq=False)
class Pings:
    """Pings: times (k,), beam velocities (k, B), and validity (k, B)."""

    time_ns: Times
    velocity_mps: Floats
    valid: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Scalars:
    """Readings of a scalar sensor, (n,): depth in m below the origin, or heading in rad from north."""

    time_ns: Times
    value: Floats


@dataclass(frozen=True, eq=False)
class Mission:
    """The readings; `grid_ns` (n,) are the times at which an estimate is asked.

    Inertial readings are means over the interval before each time.
    """

    geometry: BeamGeometry
    model: Model
    options: Options
    start: InitialState
    imu: Inertial
    pings: Pings
    depth: Scalars
    grid_ns: Times
    heading: Scalars | None = None
    water: WaterBeams | None = None


@dataclass(frozen=True, eq=False)
class Estimates:
    """At the times of the grid (n,): velocity in platform axes (n, 3), attitude (n, 4), covariances (n, 3, 3)."""

    velocity_p_mps: Floats
    velocity_cov: Floats
    position_cov: Floats
    attitude_t_p: Floats


def replayed(mission: Mission, method: str) -> Estimates:
    """One of our methods along a mission, each estimate from the readings up to its time."""
    log: Any = {
        "imu_time_ns": mission.imu.time_ns,
        "omega_p_radps": mission.imu.omega_p_radps,
        "force_p_mps2": mission.imu.force_p_mps2,
        "dvl_time_ns": mission.pings.time_ns,
        "beam_velocity_mps": mission.pings.velocity_mps,
        "beam_valid": mission.pings.valid,
        "depth_time_ns": mission.depth.time_ns,
        "depth_m": mission.depth.value,
    }
    if mission.heading is not None:
        log |= {"heading_time_ns": mission.heading.time_ns, "heading_rad": mission.heading.value}
    water = mission.water
    if water is not None:
        log |= {
            "water_track_time_ns": water.time_ns,
            "water_track_velocity_mps": np.where(water.valid, water.velocity_mps, 0.0),
            "water_track_valid": water.valid,
            "water_track_sd_mps": water.sd_mps,
            "water_track_range_m": water.range_m,
        }
    result = replay_log(
        mission.geometry, mission.model, mission.options, [method], log, mission.start,
        sample_time_ns=mission.grid_ns, covariances=True, threads=1,
    )  # fmt: skip
    cov = result["covariance"][0]
    return Estimates(
        velocity_p_mps=result["velocity_p_mps"][0],
        velocity_cov=cov[:, VELOCITY, VELOCITY],
        position_cov=cov[:, POSITION, POSITION],
        attitude_t_p=result["attitude_t_p"][0],
    )
