"""`bottomlock live --dry-run` before anything beside bottomlock is installed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from bottomlock.ports import mavlink
from tests.cli.calls import command
from tests.live.world import VELOCITY, World

DRY_RUN = """
name = "rov"
mode = "velocity"

[dvl]
geometry = "waterlinked_a50"
beam_noise_mps = 0.05

[[source]]
name = "dvl"
address = "file:{file}"
format = "waterlinked-json"
rate_hz = 1

[log]
folder = "logs"

[[port]]
port = "odometry"
to = "udpout:127.0.0.1:9"
settings.receiver = "px4"
"""


def test_a_dry_run_needs_no_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pymavlink a message is shown by its fields, which is said once; without mcap no log is missed."""
    for module in ("pymavlink.dialects.v20", "mcap.writer"):
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(mavlink._state, "dry run", False)
    mavlink._stand_in.cache_clear()
    log, config = tmp_path / "dvl.jsonl", tmp_path / "rov.toml"
    log.write_bytes(b"".join(data for _, _, data in World(0.4).dvl()))
    config.write_text(DRY_RUN.format(file=log), encoding="utf-8")
    refused = command("live", config, cwd=tmp_path)
    assert refused.returncode == 2
    assert "pymavlink: `pip install '.[mavlink]'`" in refused.stderr
    done = command("live", "--dry-run", config, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("pip install '.[mavlink]'") == 1
    assert "odometry to udpout:127.0.0.1:9: ODOMETRY time_usec=" in done.stdout
    vx = re.search(r" vx=(\S+)", done.stdout)
    assert vx is not None
    assert abs(float(vx[1]) - VELOCITY[0]) < 0.2
    assert not (tmp_path / "logs").exists()
