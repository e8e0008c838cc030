"""`bottomlock live --dry-run` before anything beside bottomlock is installed."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from bottomlock.io.beams import read_geometry
from bottomlock.ports import mavlink
from tests.cli.calls import command

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


def pings(count: int) -> str:
    """Reports of a vehicle at 1 m/s forward, all beams valid, a second apart."""
    beams = read_geometry("waterlinked_a50").geometry.beam_velocities([[1.0, 0.0, 0.0]])[0]
    transducers = [
        {"id": k, "velocity": speed, "distance": 9.0, "rssi": -40.0, "nsd": -95.0, "beam_valid": True}
        for k, speed in enumerate(beams)
    ]
    report = {
        "time": 1000.0, "vx": 1.0, "vy": 0.0, "vz": 0.0, "fom": 0.01, "altitude": 9.0, "transducers": transducers,
        "covariance": [[1e-4, 0, 0], [0, 1e-4, 0], [0, 0, 1e-4]], "velocity_valid": True, "status": 0,
        "format": "json_v3.1", "type": "velocity",
    }  # fmt: skip
    times = [10**15 + 10**6 * k for k in range(count)]
    return "".join(
        json.dumps(report | {"time_of_validity": us, "time_of_transmission": us}) + "\r\n" for us in times
    )


def test_a_dry_run_needs_no_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pymavlink a message is shown by its fields, which is said once; without mcap no log is missed."""
    for module in ("pymavlink.dialects.v20", "mcap.writer"):
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(mavlink._state, "dry run", False)
    mavlink._stand_in.cache_clear()
    log, config = tmp_path / "dvl.jsonl", tmp_path / "rov.toml"
    log.write_text(pings(4), encoding="utf-8")
    config.write_text(DRY_RUN.format(file=log), encoding="utf-8")
    refused = command("live", config, cwd=tmp_path)
    assert refused.returncode == 2
    assert "pymavlink: `pip install '.[mavlink]'`" in refused.stderr
    done = command("live", "--dry-run", config, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("pip install '.[mavlink]'") == 1
    assert "odometry to udpout:127.0.0.1:9: ODOMETRY time_usec=" in done.stdout
    assert " vx=1.0" in done.stdout
    assert not (tmp_path / "logs").exists()
