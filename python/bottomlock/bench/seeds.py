"""Seeds: one number decides every random number of the benchmark; the one of the test split is not in the package."""

import hashlib
from pathlib import Path

import numpy as np

from bottomlock.config.toml_file import read_text
from bottomlock.errors import DataError

PUBLIC_SEED = 20261119
"""Of the train and validation splits."""

BITS = 128


def stream(seed: int, mission: str, what: str) -> np.random.Generator:
    """The random numbers of one purpose in one mission; different purposes and missions are independent.

    >>> stream(1, "m", "path").random() == stream(1, "m", "path").random() != stream(1, "m", "noise").random()
    True
    """
    return np.random.Generator(
        np.random.Philox(np.random.SeedSequence([seed, _number(mission), _number(what)]))
    )


def kernel_seed(seed: int, mission: str) -> int:
    """Seed of the sensor errors that the kernel draws, below 2⁶³."""
    return _number(f"{seed} {mission}") & (2**63 - 1)


def read_seed(path: Path) -> int:
    """The sealed seed: a file with one whole number.

    Raises:
        DataError: for a file that holds no such number, or the public seed.
    """
    text = read_text(path).strip()
    try:
        seed = int(text)
    except ValueError as error:
        raise DataError(
            f"{path}: holds '{text[:20]}', expected one whole number, the seed of the test split"
        ) from error
    if not 0 <= seed < 2**BITS or seed == PUBLIC_SEED:
        raise DataError(
            f"{path}: expected a number from 0 to 2^{BITS}, and not the public seed {PUBLIC_SEED}"
        )
    return seed


def _number(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little")
