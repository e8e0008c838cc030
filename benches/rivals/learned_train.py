"""Trains the two networks on the training split, and shows them beside the baselines on the validation split.

    bottomlock bench make --out out/bench --split train,validation
    python -m benches.rivals.learned_train --data out/bench [--seed 19]

Missions of the training split alone are learned from; the validation split says when to stop, and by how much
the standard deviations are then multiplied so that their NEES there is 3. The test split is not read.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from benches.rivals import learned_beams, learned_velocity
from benches.rivals.learned_data import Samples, baseline, joined, samples_of
from benches.rivals.learned_network import save, train
from partialdvl_bench.load import load_mission

Floats = NDArray[np.float64]
Learned = Any
"""The module of a network: its `loss`, `velocities` and `WEIGHTS`."""


def main() -> None:
    """Trains, writes the weights, prints the figures."""
    parser = argparse.ArgumentParser(description="Train the learned rivals.")
    parser.add_argument("--data", type=Path, required=True, help="directory of `bottomlock bench make`")
    parser.add_argument("--seed", type=int, default=19)
    parser.add_argument("--only", default="", help="beams or velocity; both by default")
    arguments = parser.parse_args()
    samples, validation = (split(arguments.data, name) for name in ("train", "validation"))
    print(f"{len(samples.beams)} samples to train, {len(validation.beams)} to validate")
    show("baseline", baseline(validation).velocity_mps, None, validation)
    for module, kind in (
        (learned_beams, learned_beams.BeamNetwork),
        (learned_velocity, learned_velocity.VelocityNetwork),
    ):
        name = module.__name__.rsplit("_", 1)[-1]
        if arguments.only in ("", name):
            torch.manual_seed(arguments.seed)
            fit(name, module, kind(), samples, validation, arguments.seed)


def fit(
    name: str, learned: Learned, network: nn.Module, samples: Samples, validation: Samples, seed: int
) -> None:
    """Trains one network and writes its weights."""
    outcome = train(network, learned.loss, samples, validation, seed=seed)
    error = validation.velocity_mps - (answer := learned.velocities(network, validation))[0]
    network.spread.fill_(float(np.sqrt(nees(error, answer[1]) / 3.0)))
    size = save(network, learned.WEIGHTS)
    count = sum(values.numel() for values in network.parameters())
    print(
        f"{name}: {count} weights, {size} bytes, epoch {outcome.epoch}, {outcome.seconds:.0f} s; loss "
        f"{outcome.train_loss:.3f} (training), {outcome.validation_loss:.3f} (validation); standard deviations "
        f"times {float(network.spread):.2f}"
    )
    show(name, *learned.velocities(network, validation), validation)


def split(data: Path, name: str) -> Samples:
    """The samples of all missions of a split."""
    folders = sorted(path for path in (data / name).iterdir() if path.is_dir())
    return joined([samples_of(load_mission(folder)) for folder in folders])


def show(name: str, velocity: Floats, covariance: Floats | None, samples: Samples) -> None:
    """RMS of the velocity error by the number of beams in the newest ping, and NEES where there is a covariance."""
    error = samples.velocity_mps - velocity
    beams = samples.valid[:, -1].sum(axis=1)
    for count in range(5):
        rows = beams == count
        if not rows.any():
            continue
        line = f"  {name:10} {count} beams, {rows.sum():5d} pings: RMS {rms(error[rows]):.3f} m/s"
        if covariance is not None:
            line += f", NEES {nees(error[rows], covariance[rows]):.2f} of 3"
        print(line)
    print(f"  {name:10} all: RMS {rms(error):.3f} m/s", flush=True)


def nees(error: Floats, covariance: Floats) -> float:
    """Mean over the samples."""
    weighed = np.linalg.solve(covariance, error[..., None])[..., 0]
    return float(np.mean(np.sum(error * weighed, axis=1)))


def rms(error: Floats) -> float:
    """Of the norm."""
    return float(np.sqrt(np.square(error).sum(axis=1).mean()))


if __name__ == "__main__":
    main()
