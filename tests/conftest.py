"""What every test shares: hypothesis profiles, one thread per test process, the place of the recordings."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# Test processes already use every core; set before numpy, polars and the kernel start their pools.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ["RAYON_NUM_THREADS"] = "1"
    os.environ["POLARS_MAX_THREADS"] = "1"
os.environ.setdefault("MPLBACKEND", "Agg")

# Deadlines measure the machine, not the code.
settings.register_profile("dev", max_examples=50, deadline=None)
# Continuous integration repeats the same cases, so that a red commit is the commit's fault.
settings.register_profile("ci", max_examples=200, deadline=None, derandomize=True, print_blob=True)
settings.register_profile("deep", max_examples=20_000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if "CI" in os.environ else "dev"))

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    """Top folder of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of the recordings that may not be republished; skips the test where they are absent.

    The variable BOTTOMLOCK_RECORDINGS names it; without it, `shared/data` beside the checkout.
    """
    folder = Path(os.environ.get("BOTTOMLOCK_RECORDINGS", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings in {folder}; set BOTTOMLOCK_RECORDINGS")
    return folder
