"""Missing beams regressed from the beams that return and from past pings, in the manner of MissBeamNet.

Yona & Klein, Neural Computing and Applications 36 (2024) 4947 (arXiv 2301.11597) regress the missing beams by an LSTM
over past pings and the present ones, and solve the velocity by least squares. Ours gives each beam a variance too, so
that the velocity has a covariance, and learns the difference to the moving average. README_graph.md says what else
differs.
"""

import time
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from benches.rivals.learned_data import BEAMS, Samples, baseline, samples_of
from benches.rivals.learned_network import LEAST_LOG_SD, gaussian_loss, load, static_inputs, tensor
from benches.rivals.loose_ins import aided_by
from partialdvl_bench.mission import Estimates, Mission

Floats = NDArray[np.float64]
WEIGHTS = Path(__file__).parent / "weights" / "learned_beams.npz"
HIDDEN = 32


class BeamNetwork(nn.Module):
    """An LSTM over the pings; from its last output, the beams as differences to the baseline, and their log sd.

    `spread` multiplies every standard deviation; it is fitted on the validation split after training.
    """

    spread: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.pings = nn.LSTM(2 * BEAMS, HIDDEN, batch_first=True)
        self.head = nn.Sequential(
            nn.Linear(HIDDEN + 3 * BEAMS + BEAMS + 1, 48),
            nn.ReLU(),
            nn.Dropout(0.1),
            nn.Linear(48, 2 * BEAMS),
        )
        self.register_buffer("spread", torch.ones(()))

    def forward(self, samples: Samples) -> tuple[Tensor, Tensor]:
        """Mean (n, 4) of b · v of the missing beams, and log sd (n, 4) of all."""
        base = baseline(samples)
        # Beams as differences to what the baseline's velocity gives.
        expected = np.einsum("nbk,nk->nb", samples.directions, base.velocity_mps)
        moved = np.where(samples.valid, samples.beams - expected[:, None], 0.0)
        pings = torch.cat([10.0 * tensor(moved), tensor(samples.valid)], dim=2)
        _, (last, _) = self.pings(pings)
        head = torch.cat([last[0], static_inputs(samples), tensor(samples.valid[:, -1])], dim=1)
        shift, log_sd = self.head(head).chunk(2, dim=1)
        # The unit of what is learned is a decimetre a second.
        return tensor(base.beams) + 0.1 * shift, torch.clamp(log_sd - 3.0, min=LEAST_LOG_SD, max=1.0)


def _solved(network: BeamNetwork, samples: Samples) -> tuple[Tensor, Tensor]:
    """Velocity (n, 3) and its information (n, 3, 3), by weighted least squares on measured and regressed beams.

    The errors of two beams are taken for independent, as in the source.
    """
    mean, log_sd = network(samples)
    now = samples.valid[:, -1]
    beams = torch.where(torch.from_numpy(now), tensor(samples.beams[:, -1]), mean)
    weight = tensor(samples.exists) * torch.exp(-2.0 * log_sd)
    directions = tensor(samples.directions)
    information = torch.einsum("nbi,nb,nbj->nij", directions, weight, directions)
    right = torch.einsum("nbi,nb,nb->ni", directions, weight, beams)
    return torch.linalg.solve(information, right[..., None])[..., 0], information


def loss(network: BeamNetwork, samples: Samples) -> Tensor:
    """Mean negative log likelihood of the true beams that are missing, and of the true velocity."""
    mean, log_sd = network(samples)
    error = (tensor(samples.true_beams) - mean) / torch.exp(log_sd)
    missing = tensor(samples.exists & ~samples.valid[:, -1])
    of_beams = (missing * (log_sd + 0.5 * error**2)).sum() / missing.sum().clamp(min=1.0)
    velocity, information = _solved(network, samples)
    return of_beams + gaussian_loss(tensor(samples.velocity_mps) - velocity, information)


def velocities(network: BeamNetwork, samples: Samples) -> tuple[Floats, Floats]:
    """Velocity (n, 3) and covariance (n, 3, 3)."""
    with torch.no_grad():
        velocity, information = _solved(network, samples)
        covariance = torch.linalg.inv(information.double()) * network.spread**2
    return velocity.numpy().astype(float), covariance.numpy()


def estimate_alone(mission: Mission) -> Estimates:
    """The velocity alone: no position, no attitude."""
    began = time.perf_counter()
    velocity, covariance = velocities(_trained(), samples_of(mission))
    return Estimates(mission.grid_ns, velocity, covariance, wall_s=time.perf_counter() - began)


def estimate(mission: Mission) -> Estimates:
    """The velocity as the aiding of a loosely coupled INS, which adds position and attitude."""
    return aided_by(mission, estimate_alone(mission))


@lru_cache(maxsize=1)
def _trained() -> BeamNetwork:
    return load(BeamNetwork(), WEIGHTS)
