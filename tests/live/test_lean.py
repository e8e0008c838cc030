"""What a vehicle needs: `live` runs beside requirements-live.txt alone, without tables, figures and pages."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import bottomlock
from tests.live.processes import Instruments

ENOUGH = 10
NOT_NEEDED = ("polars", "scipy", "matplotlib", "jinja2", "threadpoolctl")
BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {names}:
            raise ModuleNotFoundError("No module named " + repr(name), name=name)

sys.meta_path.insert(0, Blocked())
from bottomlock.__main__ import main
main()
"""
CONFIG = """
name = "lean"
mode = "velocity"
[dvl]
geometry = "waterlinked_a50"
[health]
port = 0
[log]
folder = "logs"
[[source]]
name = "dvl"
address = "tcp:127.0.0.1:{port}"
format = "waterlinked-json"
clock = "arrival"
rate_hz = 10
[[port]]
port = "sentence"
to = "file:sent.txt"
[[port]]
port = "vision_position_delta"
to = "udpout:127.0.0.1:9"
"""


def sent(folder: Path, *command: str) -> int:
    """How many lines `live` sends within some seconds, with its raw log."""
    with Instruments(30.0) as instruments:
        text = CONFIG.format(port=instruments.dvl_port)
        (folder / "live.toml").write_text(text, encoding="utf-8")
        process = subprocess.Popen(
            [*command, "live", "live.toml"],
            cwd=folder,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        lines, until = folder / "sent.txt", time.monotonic() + 25.0
        while time.monotonic() < until and process.poll() is None:
            if lines.exists() and lines.read_bytes().count(b"\n") > ENOUGH:
                break
            time.sleep(0.1)
        process.send_signal(signal.SIGTERM)
        _, told = process.communicate(timeout=30.0)
    assert "Traceback" not in told, told
    assert list((folder / "logs").rglob("*.mcap")), told
    return lines.read_bytes().count(b"\n")


def test_live_imports_nothing_of_tables_figures_and_pages(tmp_path: Path) -> None:
    """With these libraries away it still sends, and writes its raw log."""
    pytest.importorskip("mcap")
    pytest.importorskip("pymavlink")
    (tmp_path / "blocked.py").write_text(BLOCKED.format(names=set(NOT_NEEDED)), encoding="utf-8")
    assert sent(tmp_path, sys.executable, "blocked.py") > ENOUGH


@pytest.mark.long
def test_live_runs_beside_its_own_requirements(tmp_path: Path, root: Path) -> None:
    """An environment of requirements-live.txt and the package's files alone."""
    uv = shutil.which("uv", path=str(Path(sys.executable).parent)) or shutil.which("uv")
    if uv is None:
        pytest.skip("uv is not there")
    lean = tmp_path / "lean"
    subprocess.run([uv, "venv", "--quiet", "--python", sys.executable, str(lean)], check=True)
    python = lean / "bin" / "python"
    subprocess.run(
        [uv, "pip", "install", "--quiet", "--no-config", "--system-certs", "--python", str(python), "--require-hashes",
         "-r", str(root / "requirements-live.txt")], check=True,
    )  # fmt: skip
    (site,) = (lean / "lib").glob("python3*/site-packages")
    shutil.copytree(Path(bottomlock.__file__).parent, site / "bottomlock")
    for name in NOT_NEEDED:
        found = subprocess.run([str(python), "-c", f"import {name}"], capture_output=True, check=False)
        assert found.returncode != 0
    assert sent(tmp_path, str(python), "-m", "bottomlock") > ENOUGH
