"""The command as a process: killed in the middle, started again, and aiding from its checkpoint.

How long that takes is a matter of the machine: `benches/live_restart.py` measures it.
"""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from bottomlock.live.config import load_config
from bottomlock.live.replay import replay_log
from tests.live.processes import Instruments, heard, start


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    """What an autopilot would listen on."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        yield one


@pytest.mark.slow
def test_killed_and_aiding_again(tmp_path: Path, listener: socket.socket) -> None:
    """From the checkpoint, with the next reset counter; both raw logs give the bits that were sent."""
    config = tmp_path / "rov.toml"
    with Instruments(60.0) as instruments:
        instruments.write_config(config, listener.getsockname()[1])
        first = start(config)
        try:
            assert b",OK,3,0," in heard(listener, 30.0)
            give_up_s = time.monotonic() + 10.0
            while not (tmp_path / "last").is_file():
                assert time.monotonic() < give_up_s, "no checkpoint"
                time.sleep(0.1)
        finally:
            first.send_signal(signal.SIGKILL)
            first.communicate()
        second = start(config)
        try:
            assert b",OK,3,1," in heard(listener, 30.0)
        finally:
            second.send_signal(signal.SIGTERM)
            words = second.communicate(timeout=10.0)[1].decode()
    assert second.returncode == 0
    assert "goes on from the checkpoint of" in words
    assert "state OK: beams determine the whole velocity" in words
    logs = sorted((tmp_path / "logs").glob("*.mcap"))
    assert len(logs) == 2
    for log in logs:
        result = replay_log(load_config(config), log)
        assert result.first_difference == ""
        assert result.sent > 0
