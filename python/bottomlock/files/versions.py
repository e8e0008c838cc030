"""Versions of the libraries on which the bits of a table depend."""

import hashlib
import importlib.metadata
import platform
from collections.abc import Mapping
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from bottomlock.errors import DataError

_BUILD_DIGITS = 12
"""Digits of a build's digest that a message shows."""


def library_versions() -> dict[str, str]:
    """Versions on which the bits depend, beside our own."""
    return {"python": platform.python_version(), "numpy": np.__version__, "polars": pl.__version__}


def bit_versions() -> dict[str, str]:
    """What must agree for finished parts to be kept: our version, numpy, polars, and the kernel's build."""
    return {
        "bottomlock": importlib.metadata.version("bottomlock"),
        "numpy": np.__version__,
        "polars": pl.__version__,
        "kernel_build": kernel_build(),
    }


@lru_cache(maxsize=1)
def kernel_build() -> str:
    """SHA-256 of the compiled kernel's file: two builds of one version may differ in their last bits."""
    spec = find_spec("bottomlock._kernel")
    assert spec is not None
    assert spec.origin is not None
    return hashlib.sha256(Path(spec.origin).read_bytes()).hexdigest()


def versions_in_words(held: Mapping[str, str], ours: Mapping[str, str]) -> str:
    """The versions that differ, in words; empty where none does.

    >>> ours = {"numpy": "2.1.0", "polars": "2.1.0", "kernel_build": "0123456789abcdef"}
    >>> versions_in_words(ours | {"numpy": "2.0.2"}, ours)
    'numpy 2.0.2 (here 2.1.0)'
    >>> versions_in_words(ours | {"kernel_build": "f" * 64}, ours)
    'another build of the kernel ffffffffffff (here 0123456789ab)'
    """
    words = []
    for name, here in ours.items():
        there = str(held.get(name, "unknown"))
        if there != here and name == "kernel_build":
            words.append(f"another build of the kernel {there[:_BUILD_DIGITS]} (here {here[:_BUILD_DIGITS]})")
        elif there != here:
            words.append(f"{name} {there} (here {here})")
    return ", ".join(words)


def check_identity(
    place: Path, record: Mapping[str, Any], identity: Mapping[str, Any], *, remedy: str
) -> None:
    """Checks that what a record states was made of this `configuration_hash` and with these `versions`.

    Raises:
        DataError: naming the record, what differs, and the remedy.
    """
    if record.get("configuration_hash") != identity["configuration_hash"]:
        raise DataError("is of another configuration", place=place, hint=remedy)
    other = versions_in_words(dict(record.get("versions", {})), identity["versions"])
    if other:
        raise DataError(f"was made with {other}", place=place, hint=remedy)
