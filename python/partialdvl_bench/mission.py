"""A mission of the benchmark, as an estimator receives it, and what it has to answer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bottomlock import BeamGeometry, InitialState, Model, Options
from bottomlock.recordings.streams import Inertial, WaterBeams

Floats = NDArray[np.float64]
Times = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Pings:
    """Pings: times (k,), beam velocities (k, B) with NaN for a beam that did not return, and validity (k, B)."""

    time_ns: Times
    velocity_mps: Floats
    valid: Flags


@dataclass(frozen=True, eq=False)
class Scalars:
    """Readings of a scalar sensor, (n,): depth in m below the origin, or heading in rad from north."""

    time_ns: Times
    value: Floats


@dataclass(frozen=True, eq=False)
class Start:
    """The state that an estimator begins with, at the time of an IMU sample; its 1 sigma are `Mission.model.initial`.

    Position in the tangent frame (3,), velocity in platform axes (3,), attitude from platform to tangent as a unit
    quaternion, scalar first, (4,).
    """

    time_ns: int
    position_t_m: Floats
    velocity_p_mps: Floats
    attitude_t_p: Floats


@dataclass(frozen=True, eq=False)
class Truth:
    """The true states at `Mission.grid_ns` (n,); the current is the velocity of the water, north and east, (n, 2)."""

    time_ns: Times
    position_t_m: Floats
    velocity_p_mps: Floats
    attitude_t_p: Floats
    current_t_mps: Floats


@dataclass(frozen=True, eq=False)
class Mission:
    """All that an estimator may know of a mission, and the truth where it is not sealed.

    `model` and `options` hold the claimed errors of every sensor and the lever arms; `grid_ns` (n,) are the times at
    which an estimate is asked, the first of them after the start. Inertial readings are means over the interval before
    each time. `water` is None where the DVL has no water track.
    """

    name: str
    split: str
    geometry: BeamGeometry
    model: Model
    options: Options
    start: Start
    imu: Inertial
    pings: Pings
    depth: Scalars
    heading: Scalars
    grid_ns: Times
    truth: Truth | None
    water: WaterBeams | None = None


def initial_state(mission: Mission) -> InitialState:
    """The state at the start as the kernel takes it, with biases of zero."""
    start = mission.start
    return InitialState(
        time_ns=start.time_ns,
        position_t_m=start.position_t_m,
        attitude_t_p=start.attitude_t_p,
        velocity_p_mps=start.velocity_p_mps,
    )


@dataclass(frozen=True, eq=False)
class Estimates:
    """What an estimator answers at the times of the grid (n,), each from readings up to that time alone.

    Velocity in platform axes (n, 3) and position in the tangent frame (n, 3), with covariances (n, 3, 3); attitude from
    platform to tangent (n, 4), scalar first; the water's velocity, north and east, (n, 2), with covariances (n, 2, 2).
    What an estimator does not answer is None; a row that it cannot answer is NaN. `wall_s` is the time the filter took.
    """

    time_ns: Times
    velocity_p_mps: Floats
    velocity_cov: Floats
    position_t_m: Floats | None = None
    position_cov: Floats | None = None
    attitude_t_p: Floats | None = None
    current_t_mps: Floats | None = None
    current_cov: Floats | None = None
    wall_s: float | None = None
