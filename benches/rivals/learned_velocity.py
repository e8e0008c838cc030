"""The velocity regressed from beams and inertial readings, in the manner of BeamsNet.

Cohen & Klein, Engineering Applications of Artificial Intelligence 114 (2022) 105216 (arXiv 2206.13603): convolutions
over the inertial readings between two pings, joined by the beams, give the velocity (BeamsNetV1); past pings are its
second version. Ours takes both, any mask, and gives a full covariance; it learns the difference to least squares.
README_graph.md says what else differs.
"""

import time
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from benches.rivals.learned_data import BEAMS, PINGS, Samples, baseline, samples_of
from benches.rivals.learned_network import LEAST_LOG_SD, gaussian_loss, load, static_inputs, tensor
from benches.rivals.loose_ins import aided_by
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]
WEIGHTS = Path(__file__).parent / "weights" / "learned_velocity.npz"
ROWS, COLUMNS = np.tril_indices(3, -1)


class VelocityNetwork(nn.Module):
    """Convolutions over the inertial means and a layer over the pings; velocity and the factor of its information.

    `spread` multiplies every standard deviation; it is fitted on the validation split after training.
    """

    spread: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.inertial = nn.Sequential(
            nn.Conv1d(6, 8, 5),
            nn.Tanh(),
            nn.Conv1d(8, 8, 5, stride=2),
            nn.Tanh(),
            nn.Flatten(),
            nn.Linear(72, 16),
        )
        self.pings = nn.Sequential(nn.Linear(2 * BEAMS * PINGS, 64), nn.ReLU())
        self.head = nn.Sequential(
            nn.Linear(16 + 64 + 3 * BEAMS + 1, 48), nn.ReLU(), nn.Dropout(0.1), nn.Linear(48, 9)
        )
        self.register_buffer("spread", torch.ones(()))

    def forward(self, samples: Samples) -> tuple[Tensor, Tensor]:
        """Mean (n, 3), and the lower factor L (n, 3, 3) of the information: P⁻¹ = L Lᵀ."""
        base = baseline(samples)
        expected = np.einsum("nbk,nk->nb", samples.directions, base.velocity_mps)
        moved = np.where(samples.valid, samples.beams - expected[:, None], 0.0)
        pings = torch.cat([10.0 * tensor(moved), tensor(samples.valid)], dim=2).flatten(1)
        joined = [self.inertial(tensor(samples.inertial)), self.pings(pings), static_inputs(samples)]
        out = self.head(torch.cat(joined, dim=1))
        log_sd = torch.clamp(out[:, 3:6] - 3.0, min=LEAST_LOG_SD, max=1.0)
        factor = torch.diag_embed(torch.exp(-log_sd))
        # What couples two axes is in the unit of the diagonal, so that L stays well scaled.
        factor[:, ROWS, COLUMNS] = out[:, 6:] * torch.exp(-log_sd[:, ROWS])
        return tensor(base.velocity_mps) + 0.1 * out[:, :3], factor


def loss(network: VelocityNetwork, samples: Samples) -> Tensor:
    """Mean negative log likelihood of the true velocity."""
    mean, factor = network(samples)
    return gaussian_loss(tensor(samples.velocity_mps) - mean, factor @ factor.transpose(1, 2))


def velocities(network: VelocityNetwork, samples: Samples) -> tuple[Floats, Floats]:
    """Velocity (n, 3) and covariance (n, 3, 3)."""
    with torch.no_grad():
        mean, factor = network(samples)
        lower = factor.double()
        covariance = torch.linalg.inv(lower @ lower.transpose(1, 2)) * network.spread**2
    return mean.numpy().astype(float), covariance.numpy()


def estimate_alone(mission: Mission) -> Estimates:
    """The velocity alone: no position, no attitude."""
    began = time.perf_counter()
    velocity, covariance = velocities(_trained(), samples_of(mission))
    return Estimates(mission.grid_ns, velocity, covariance, wall_s=time.perf_counter() - began)


def estimate(mission: Mission) -> Estimates:
    """The velocity as the aiding of a loosely coupled INS, which adds position and attitude."""
    return aided_by(mission, estimate_alone(mission))


@lru_cache(maxsize=1)
def _trained() -> VelocityNetwork:
    return load(VelocityNetwork(), WEIGHTS)
