"""What a vehicle needs: `live` runs without tables, figures and pages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.calls import command
from tests.live.world import World

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
[log]
folder = "logs"
[[source]]
name = "dvl"
address = "file:dvl.log"
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
    """How many lines `live` sends of a log, with its raw log."""
    (folder / "live.toml").write_text(CONFIG, encoding="utf-8")
    (folder / "dvl.log").write_bytes(b"".join(data for _, _, data in World(3.0).dvl()))
    done = subprocess.run(
        [*command, "live", "live.toml"], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert list((folder / "logs").rglob("*.mcap")), done.stderr
    return (folder / "sent.txt").read_bytes().count(b"\n")


def test_live_imports_nothing_of_tables_figures_and_pages(tmp_path: Path) -> None:
    """With these libraries away it still sends, and writes its raw log."""
    pytest.importorskip("mcap")
    pytest.importorskip("pymavlink")
    (tmp_path / "blocked.py").write_text(BLOCKED.format(names=set(NOT_NEEDED)), encoding="utf-8")
    assert sent(tmp_path, sys.executable, "blocked.py") > 0


def test_a_dry_run_names_a_missing_library_and_misses_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("pymavlink.dialects.v20", "mcap.writer"):
        monkeypatch.setitem(sys.modules, module, None)
    log, config = tmp_path / "dvl.log", tmp_path / "rov.toml"
    log.write_bytes(b"".join(data for _, _, data in World(0.4).dvl()))
    config.write_text(CONFIG, encoding="utf-8")
    refused = command("live", "--dry-run", config, cwd=tmp_path)
    assert refused.returncode == 2
    assert "pymavlink: `pip install '.[mavlink]'`" in refused.stderr
    config.write_text(CONFIG.partition('[[port]]\nport = "vision')[0], encoding="utf-8")
    done = command("live", "--dry-run", config, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "sent.txt: $PBLKV" in done.stdout
    assert not (tmp_path / "logs").exists()


def test_a_dry_run_without_a_dvl_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With what each source does."""
    monkeypatch.setattr("bottomlock.cli.live.PATIENCE_S", 0.5)
    config = tmp_path / "rov.toml"
    config.write_text(CONFIG.replace("file:dvl.log", "tcp:127.0.0.1:1"), encoding="utf-8")
    done = command("live", "--dry-run", config, cwd=tmp_path)
    assert done.returncode == 2
    assert "no ping of source 'dvl' within 0.5 s: dvl cannot be opened" in done.stderr
