"""Seeds: one number decides every random number of the benchmark; the one of the test split is not in the package."""

import hashlib
import os
import secrets
from importlib import resources
from pathlib import Path

import numpy as np

from bottomlock import DataError, OutputError
from bottomlock.config.toml_file import parse_toml, read_text

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


def seal(path: Path, version: str) -> str:
    """Draws a seed of 128 random bits into a new file that its owner alone can read, and returns its commitment.

    Raises:
        OutputError: for a file that is there, and one that cannot be written.
    """
    seed = secrets.randbits(BITS)
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(f"{seed}\n")
    except FileExistsError as error:
        raise OutputError(f"{path}: is there; a seed is never written over, expected a new file") from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    return commitment(seed, version)


def commitment(seed: int, version: str) -> str:
    """What is published of a sealed seed before it is used: SHA-256, 64 hex digits, of a line of text.

    Of 128 random bits it tells nothing, and no other seed that could be found has the same.

    >>> commitment(12, "1.1") == hashlib.sha256(b"PartialDVL-Bench 1.1: 12").hexdigest()
    True
    """
    return hashlib.sha256(f"PartialDVL-Bench {version}: {seed}".encode()).hexdigest()


def commitments() -> dict[str, str]:
    """The published commitments by version (sealed.toml)."""
    text = (resources.files("partialdvl_bench") / "sealed.toml").read_text(encoding="utf-8")
    content: dict[str, str] = parse_toml(text, place="partialdvl_bench/sealed.toml")
    return content


def read_sealed(path: Path, version: str) -> int:
    """The sealed seed of a version, from its file.

    Raises:
        DataError: as `read_seed`, and for a seed of another commitment than the published one.
    """
    seed, published = read_seed(path), commitments().get(version)
    if published is not None and commitment(seed, version) != published:
        raise DataError(
            f"{path}: is not the sealed seed of version {version}: its commitment is "
            f"{commitment(seed, version)[:16]}…, published is {published[:16]}…"
        )
    return seed


def _number(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little")
