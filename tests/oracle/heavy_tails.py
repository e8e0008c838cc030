"""Updates with heavy-tailed noise as their papers write them: dense, in the space of the state, nothing exploited."""

import numpy as np

from tests.oracle import kalman
from tests.oracle.rotations import Array


def student_t(P: Array, H: Array, sd: Array, z: Array, degrees: float) -> tuple[Array, Array, Array]:
    """Correction, covariance and weights of the variational update (Agamennoni et al. 2012), one weight per reading.

    In turn: the state given the weights, a Kalman update with variances sd²/w; the weights given the state,
    w = (ν + 1) / (ν + E[(z − H x)²]/sd²), the expectation over the state's own posterior.
    """
    w = np.ones(len(z))
    for _ in range(2000):
        x, posterior = kalman.update(np.zeros(len(P)), P, H, np.diag(sd**2 / w), z)
        expected = (z - H @ x) ** 2 + np.diag(H @ posterior @ H.T)
        w = (degrees + 1) / (degrees + expected / sd**2)
    x, posterior = kalman.update(np.zeros(len(P)), P, H, np.diag(sd**2 / w), z)
    return x, posterior, w
