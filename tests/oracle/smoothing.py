"""Fixed-interval smoothing without a recursion: the joint covariance of the whole history, conditioned on all readings.

e_k is the error of the nominal state at epoch k, after what an update fed back: e_k = Φ_k e_{k−1} + w_k − c_k. A
reading at epoch k has the innovation z_k = H_k (e_k + c_k) + n_k, taken before the feedback c_k. Cost grows with the
cube of the history.
"""

from dataclasses import dataclass

import numpy as np

from tests.oracle.rotations import Array


@dataclass(frozen=True)
class Epoch:
    """From one epoch to the next: Φ and Q, then readings (H, R, z; none with no rows) and the feedback c."""

    Phi: Array
    Q: Array
    H: Array
    R: Array
    z: Array
    fed_back: Array


def smooth(P0: Array, epochs: list[Epoch]) -> tuple[Array, Array]:
    """Mean (N + 1, n) and covariance (N + 1, n, n) of e_0 … e_N given every reading."""
    n, count = len(P0), len(epochs) + 1
    mean, joint = np.zeros(n * count), np.zeros((n * count, n * count))
    joint[:n, :n] = P0
    rows: list[Array] = []
    noise: list[Array] = []
    reading: list[float] = []
    for k, epoch in enumerate(epochs, start=1):
        old, new = slice(n * (k - 1), n * k), slice(n * k, n * (k + 1))
        mean[new] = epoch.Phi @ mean[old] - epoch.fed_back
        joint[new, : n * k] = epoch.Phi @ joint[old, : n * k]
        joint[: n * k, new] = joint[new, : n * k].T
        joint[new, new] = epoch.Phi @ joint[old, old] @ epoch.Phi.T + epoch.Q
        for i, h in enumerate(epoch.H):
            row = np.zeros(n * count)
            row[new] = h
            rows.append(row)
            noise.append(epoch.R[i, i])
            reading.append(float(epoch.z[i] - h @ epoch.fed_back))
    H = np.array(rows)
    # Readings in units of their own uncertainty: S then has a unit diagonal.
    S = H @ joint @ H.T + np.diag(noise)
    scale = 1 / np.sqrt(np.diag(S))
    gain = (joint @ (H * scale[:, None]).T) @ np.linalg.inv(S * np.outer(scale, scale))
    mean = mean + gain @ (scale * (np.array(reading) - H @ mean))
    joint = joint - gain @ ((H * scale[:, None]) @ joint)
    blocks = [joint[n * k : n * (k + 1), n * k : n * (k + 1)] for k in range(count)]
    return mean.reshape(count, n), np.array(blocks)
