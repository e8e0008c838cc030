"""What the two networks share: inputs, training with an early stop, and weights in a file."""

import io
import time
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor, nn

from benches.rivals.learned_data import Samples, mirrored, with_fewer_beams
from bottomlock.errors import DataError
from bottomlock.files.atomic_write import write_bytes

LEAST_LOG_SD = -6.0
"""2.5 mm/s: no sample of a likelihood is worth more."""

Network = TypeVar("Network", bound=nn.Module)
Loss = Callable[[Any, Samples], Tensor]


@dataclass(frozen=True)
class Schedule:
    """How long and how fast: the network is that of the epoch with the least loss on the validation split."""

    epochs: int = 80
    patience: int = 20
    batch: int = 256
    rate: float = 1e-3
    decay: float = 1e-2


@dataclass(frozen=True)
class Trained:
    """What training came to: losses of the epoch that was kept, which it was, and the seconds of all."""

    train_loss: float
    validation_loss: float
    epoch: int
    seconds: float


def train(
    network: nn.Module,
    loss: Loss,
    samples: Samples,
    validation: Samples,
    *,
    seed: int,
    schedule: Schedule | None = None,
) -> Trained:
    """Trains in place; in every epoch other beams are left out of the samples, and other samples are mirrored.

    Args:
        network: new.
        loss: of the network on samples.
        samples: the training split.
        validation: the validation split, for the early stop alone.
        seed: of order and masks; the network's own weights are the caller's.
        schedule: the default for None.
    """
    began, plan = time.perf_counter(), schedule or Schedule()
    generator = np.random.default_rng(seed)
    optimiser = torch.optim.AdamW(network.parameters(), lr=plan.rate, weight_decay=plan.decay)
    slower = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, plan.epochs, eta_min=0.05 * plan.rate)
    best, kept = Trained(np.inf, np.inf, -1, 0.0), network.state_dict()
    for epoch in range(plan.epochs):
        network.train()
        # Every sample as it is, and once more with fewer beams.
        total, batches = 0.0, 0
        order = generator.permutation(2 * len(samples.beams))
        fewer = with_fewer_beams(samples, generator)
        for start in range(0, len(order), plan.batch):
            picked = order[start : start + plan.batch]
            whole = picked < len(samples.beams)
            rows = _rows(samples, fewer, picked[whole], picked[~whole] - len(samples.beams))
            value = loss(network, mirrored(rows, generator.random(len(picked)) < 0.5))
            optimiser.zero_grad()
            value.backward()  # type: ignore[no-untyped-call] # torch's own
            nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimiser.step()
            total, batches = total + float(value.detach()), batches + 1
        slower.step()
        network.eval()
        with torch.no_grad():
            held_out = float(loss(network, validation))
        if held_out < best.validation_loss:
            best = Trained(total / batches, held_out, epoch, 0.0)
            kept = {name: value.clone() for name, value in network.state_dict().items()}
        if epoch - best.epoch >= plan.patience:
            break
    network.load_state_dict(kept)
    network.eval()
    return Trained(best.train_loss, best.validation_loss, best.epoch, time.perf_counter() - began)


def _rows(whole: Samples, fewer: Samples, of_whole: NDArray[Any], of_fewer: NDArray[Any]) -> Samples:
    return Samples(
        **{
            field.name: np.concatenate(
                [getattr(whole, field.name)[of_whole], getattr(fewer, field.name)[of_fewer]]
            )
            for field in fields(Samples)
        }
    )


def gaussian_loss(error: Tensor, information: Tensor) -> Tensor:
    """Mean negative log likelihood of errors (n, 3) by their information (n, 3, 3), without its constant."""
    square = torch.einsum("ni,nij,nj->n", error, information, error)
    return (0.5 * (square - torch.linalg.slogdet(information).logabsdet)).mean()


def tensor(values: ArrayLike) -> Tensor:
    """Single precision."""
    return torch.from_numpy(np.ascontiguousarray(values, np.float32))


def static_inputs(samples: Samples) -> Tensor:
    """The instrument, (n, 13): directions of the beams, and its claimed noise."""
    noise = 20.0 * samples.noise_mps[:, None]
    return torch.cat([tensor(samples.directions).flatten(1), tensor(noise)], dim=1)


def save(network: nn.Module, path: Path) -> int:
    """Writes the weights as arrays, and returns the size in bytes."""
    content = io.BytesIO()
    np.savez_compressed(content, **{name: value.numpy() for name, value in network.state_dict().items()})
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, content.getvalue())
    return len(content.getvalue())


def load(network: Network, path: Path) -> Network:
    """The network with the weights of a file.

    Raises:
        DataError: where there is none, or they are of another network.
    """
    if not path.is_file():
        raise DataError(f"{path}: no weights; make them with python -m benches.rivals.learned_train")
    with np.load(path) as arrays:
        found = {name: torch.from_numpy(arrays[name]) for name in arrays.files}
    try:
        network.load_state_dict(found)
    except RuntimeError as error:
        raise DataError(f"{path}: the weights are of another network; train again ({error})") from error
    return network.eval()
