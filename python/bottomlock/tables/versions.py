"""Versions of the libraries on which the bits of a table depend."""

import platform

import numpy as np
import polars as pl


def library_versions() -> dict[str, str]:
    """Versions on which the bits depend, beside our own."""
    return {"python": platform.python_version(), "numpy": np.__version__, "polars": pl.__version__}
