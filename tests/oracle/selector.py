"""Tal et al. 2017, Eqs. 48 and 49: per axis the method that claims the least variance."""

import numpy as np

from tests.oracle.rotations import Array


def select(variances: dict[str, Array]) -> tuple[list[str], Array]:
    """Names of the chosen methods for (u, v, w) and the diagonal R_vel of Eq. 49.

    `variances` maps a method to its three variances, infinite where it gives no value. Ties go to the first.
    """
    chosen: list[str] = []
    least: list[float] = []
    for axis in range(3):
        best = min(variances, key=lambda method: float(variances[method][axis]))
        chosen.append(best)
        least.append(float(variances[best][axis]))
    return chosen, np.diag(least)
