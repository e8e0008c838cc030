"""The C library, built and installed once for each test process; cargo keeps what it has built."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from tests.c.navigator import CLibrary
from tools.install_c import install


@pytest.fixture(scope="session")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An installed prefix."""
    if not sys.platform.startswith("linux"):
        pytest.skip("the C library is installed on Linux alone")
    if shutil.which("cargo") is None:
        pytest.skip("cargo builds the C library, and is not here")
    folder = tmp_path_factory.mktemp("prefix")
    install(folder)
    return folder


@pytest.fixture(scope="session")
def c(prefix: Path) -> CLibrary:
    """The shared library."""
    return CLibrary(prefix)
