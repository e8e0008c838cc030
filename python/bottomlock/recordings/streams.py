"""The streams of a recording, in SI, on one clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bottomlock.libraries import transform

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation, Slerp

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Times = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Depths:
    """Depth below the level of the tangent frame's origin, m, (n,), positive down."""

    time_ns: Times
    depth_m: Floats

    def kept(self, rows: Flags) -> Depths:
        """Those of the rows (n,)."""
        return Depths(self.time_ns[rows], self.depth_m[rows])


@dataclass(frozen=True, eq=False)
class Attitudes:
    """Attitudes of the platform against north, east and down at the vehicle, as recorded, (n,)."""

    time_ns: Times
    attitude: Rotation

    @property
    def rpy_rad(self) -> Floats:
        """(n, 3) roll, pitch, yaw, rad."""
        return np.asarray(self.attitude.as_euler("ZYX")[..., ::-1])

    def kept(self, rows: Flags) -> Attitudes:
        """Those of the rows (n,)."""
        return Attitudes(self.time_ns[rows], self.attitude[rows])

    def at(self, time_ns: Times) -> Rotation:
        """At any times (m,), on the shortest way between two of them; the first and the last hold beyond them."""
        first_ns, last_ns = int(self.time_ns[0]), int(self.time_ns[-1])
        return self._between((np.clip(time_ns, first_ns, last_ns) - first_ns) * 1e-9)

    def covers(self, time_ns: Times, longest_step_s: float) -> Flags:
        """Which times (m,) lie between two attitudes that are no longer apart than this."""
        rows = np.clip(np.searchsorted(self.time_ns, time_ns, side="right"), 1, max(len(self.time_ns) - 1, 1))
        inside = (time_ns >= self.time_ns[0]) & (time_ns <= self.time_ns[-1])
        return np.asarray(inside & (self.time_ns[rows] - self.time_ns[rows - 1] <= longest_step_s * 1e9))

    @cached_property
    def _between(self) -> Slerp:
        # Seconds from the first: whole nanoseconds of a Unix time do not fit a float.
        return transform.Slerp((self.time_ns - self.time_ns[0]) * 1e-9, self.attitude)


@dataclass(frozen=True, eq=False)
class Inertial:
    """IMU readings: times (n,), specific force and inertial rate in the platform frame, (n, 3) each."""

    time_ns: Times
    force_p_mps2: Floats
    omega_p_radps: Floats

    def rows(self, rows: slice | Integers) -> Inertial:
        """Some of them."""
        return Inertial(self.time_ns[rows], self.force_p_mps2[rows], self.omega_p_radps[rows])


def integrator(time_ns: Times, values: Floats, origin_ns: int) -> Callable[[Times], Floats]:
    """`integrals` as a function of the edges; times are counted from an origin near them."""
    seconds = (time_ns - origin_ns) * 1e-9
    steps = np.diff(seconds)[:, None] * 0.5 * (values[1:] + values[:-1])
    total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])

    def between(edges_ns: Times) -> Floats:
        at = (edges_ns - origin_ns) * 1e-9
        return np.diff(np.stack([np.interp(at, seconds, column) for column in total.T], axis=1), axis=0)

    return between


def integrals(time_ns: Times, values: Floats, edges_ns: Times) -> Floats:
    """(m − 1, 3) integrals between edges (m,) of readings (n, 3) at times (n,), straight from one to the next."""
    return integrator(time_ns, values, int(edges_ns[0]))(edges_ns)


@dataclass(frozen=True, eq=False)
class Beams:
    """Pings: times (n,), beam velocities (n, B) with NaN for a lost beam, validity and noise 1 sigma, (n, B) each.

    `velocity_d_mps` (n, 3) is the instrument's velocity that the beams were projected from; None for recorded beams.
    `range_m` (n, B) is there where the noise grows with it.
    """

    time_ns: Times
    velocity_mps: Floats
    valid: Flags
    sd_mps: Floats
    velocity_d_mps: Floats | None = None
    range_m: Floats | None = None


@dataclass(frozen=True, eq=False)
class WaterBeams:
    """Beams that the water returned, a row a ping; (n, B) each but `time_ns` and `range_m`.

    Attributes:
        time_ns: (n,) times, strictly rising.
        velocity_mps: through the water, as those of the bottom in sign; NaN where lost.
        valid: which beams there are.
        sd_mps: their noise, 1 sigma.
        range_m: (n,) along the beam from the transducer to the middle of the cell.
    """

    time_ns: Times
    velocity_mps: Floats
    valid: Flags
    sd_mps: Floats
    range_m: Floats


@dataclass(frozen=True, eq=False)
class Revolutions:
    """Revolutions of the propeller a second, (n,), positive where they drive the vehicle forward."""

    time_ns: Times
    revolutions_hz: Floats


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces of the thrusters along surge, sway and heave, (n, 3), N."""

    time_ns: Times
    force_p_n: Floats


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions of a point of the vehicle in the tangent frame, (n, 3), and their 1 sigma where recorded, (n, 3).

    `geodetic` (n, 3) are the latitude and longitude, deg, and height, m, that they are made of, None without such.
    """

    time_ns: Times
    position_t_m: Floats
    sd_m: Floats | None = None
    geodetic: Floats | None = None

    def kept(self, rows: Flags) -> Positions:
        """Those of the rows (n,)."""
        sd_m, geodetic = (None if of is None else of[rows] for of in (self.sd_m, self.geodetic))
        return Positions(self.time_ns[rows], self.position_t_m[rows], sd_m, geodetic)


@dataclass(frozen=True, eq=False)
class ReferenceStates:
    """Reference states of the IMU: times (n,), position, velocity and attitude, each None where it is absent.

    Positions are in the tangent frame; attitudes against north, east and down at the vehicle.

    Without `has_down` the reference measures no height: its positions are on the level of the origin.
    """

    time_ns: Times
    position_t_m: Floats | None
    velocity_p_mps: Floats | None
    attitude: Rotation | None
    has_down: bool = True
