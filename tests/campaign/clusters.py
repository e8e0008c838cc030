"""A Dask cluster on this machine, for tests."""

import logging
from typing import Any

import pytest


def two_processes() -> Any:  # noqa: ANN401 - distributed is untyped
    """A cluster of two worker processes, as a context; skips where distributed is not installed."""
    distributed = pytest.importorskip("distributed")
    return distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address="127.0.0.1:0",
        memory_limit=0,
        silence_logs=logging.CRITICAL,
    )
