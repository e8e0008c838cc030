"""An acoustic position fix as its equations stand: z = p + R l + n, sd = sqrt(sd0^2 + (k |z - t|)^2) on each axis."""

import numpy as np

from tests.oracle.rotations import Array, skew

STATES = 20
POSITION, MISALIGNMENT = slice(0, 3), slice(3, 6)


def expected_fix(position_t: Array, attitude_t_p: Array, lever_p: Array) -> Array:
    """Where the transponder is."""
    place: Array = position_t + attitude_t_p @ lever_p
    return place


def deviation(fix_t: Array, transceiver_t: Array, sd_m: float, sd_per_range: float) -> float:
    """Standard deviation of each axis, with the slant range to the fix."""
    slant_range = np.sqrt(np.sum((fix_t - transceiver_t) ** 2))
    return float(np.sqrt(sd_m**2 + (sd_per_range * slant_range) ** 2))


def jacobian(attitude_t_p: Array, lever_p: Array) -> Array:
    """By the 20 error states: with R = Exp([rho x]) R^, the arm R l changes by rho x R l = -[(R l) x] rho."""
    H = np.zeros((3, STATES))
    H[:, POSITION] = np.eye(3)
    H[:, MISALIGNMENT] = -skew(attitude_t_p @ lever_p)
    return H
