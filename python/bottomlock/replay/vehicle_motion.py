"""How a vehicle's velocity changes along its own axes, measured on complete pings by its structure function."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from bottomlock.dead_reckoning.track import structure_function
from bottomlock.errors import DataError
from bottomlock.kernel import local_earth
from bottomlock.kernel.models import Environment
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.streams import VehicleMotion


def level_axes(environment: Environment, position_t_m: ArrayLike) -> Rotation:
    """(n,) rotations from north, east and down at positions (n, 3), m, to the tangent frame."""
    position = np.nan_to_num(np.asarray(position_t_m, dtype=np.float64))
    if environment.earth == "tangent_plane":
        return Rotation.identity(len(position))
    return Rotation.from_matrix(local_earth(environment, position)["rotation_t_n"])


LONGEST_LAG_S = 300.0
"""Times over which a vehicle that has lost the bottom has to be predicted."""
TIMES_S = np.geomspace(10.0, 2000.0, 30)
"""Correlation times that are tried; what changes faster is taken for noise of the DVL."""
FEWEST_LAGS = 4
"""Lags from which three numbers are fitted."""


def vehicle_motion(pinged_ns: Times, velocity_p_mps: Floats) -> VehicleMotion:
    """Fits D(t) = 2 r² + 2 σ² (1 − exp(−t/τ)) to the mean squared difference of pings t apart, per axis.

    Args:
        pinged_ns: (p,) rising times of complete pings.
        velocity_p_mps: (p, 3) their velocities, platform axes.

    Raises:
        DataError: for too few pings.
    """
    measured = structure_function(pinged_ns, velocity_p_mps, np.zeros(3))
    rows = np.zeros(0, dtype=np.int64)
    if measured is not None:
        rows = np.flatnonzero((measured.lag_s > 0.0) & (measured.lag_s <= LONGEST_LAG_S))
    if measured is None or len(rows) < FEWEST_LAGS:
        raise DataError(
            f"the accelerations of the vehicle cannot be measured on {len(pinged_ns)} pings with a whole velocity: "
            "give imu.errors.accel_noise_mps_per_rt_h"
        )
    fits = np.array([_fit(measured.lag_s[rows], square) for square in measured.change_m2ps2[rows].T])
    return VehicleMotion(
        fluctuation_sd_mps=fits[:, 1], fluctuation_time_s=fits[:, 2], white_sd_mps=fits[:, 0],
        mean_mps=velocity_p_mps.mean(axis=0), pings=len(pinged_ns),
    )  # fmt: skip


def _fit(lags_s: Floats, squares: Floats) -> tuple[float, float, float]:
    """White noise, fluctuation (1 sigma) and correlation time of an axis, each lag with the same relative weight."""
    weight = 1.0 / np.maximum(squares, 1e-12)
    fits = []
    for time_s in TIMES_S:
        columns = np.stack([np.full(len(lags_s), 2.0), 2.0 * (1.0 - np.exp(-lags_s / time_s))], axis=1)
        parts, misfit = nnls(columns * weight[:, None], squares * weight)
        fits.append((misfit, *np.sqrt(parts), time_s))
    return min(fits)[1:]
