"""The C library, built and installed once for each test process, on the kernel that the wheel is made of."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from tests.c.navigator import CLibrary
from tools.install_c import install


@pytest.fixture(scope="session")
def prefix(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An installed prefix; a test of `make test-deep` installs what users do, without the simulation."""
    if not sys.platform.startswith("linux"):
        pytest.skip("the C library is installed on Linux alone")
    if shutil.which("cargo") is None:
        pytest.skip("cargo builds the C library, and is not here")
    folder = tmp_path_factory.mktemp("prefix")
    target = root / os.environ.get("CARGO_TARGET_DIR", "target")
    with pytest.MonkeyPatch.context() as patch:
        # As maturin has set it for the wheel: without it cargo compiles PyO3 again, and once more for the next wheel.
        for interpreter in (target / "maturin").glob("pyo3-config-*.txt"):
            patch.setenv("PYO3_CONFIG_FILE", str(interpreter))
        install(folder, ["wheel-kernel"])
    return folder


@pytest.fixture(scope="session")
def c(prefix: Path) -> CLibrary:
    """The shared library."""
    return CLibrary(prefix)
