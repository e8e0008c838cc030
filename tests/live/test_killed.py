"""The command as a process: killed in the middle, started again, and aiding within two seconds of its start."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import pytest

from bottomlock.live.config import load_config
from bottomlock.live.replay import replay_log
from tests.live.world import NAVIGATION_TOML, START_NS, World


def free_port(kind: socket.SocketKind) -> int:
    """A port that nobody uses."""
    with socket.socket(socket.AF_INET, kind) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Instruments:
    """DVL and IMU that go on whatever happens to who listens."""

    def __init__(self, seconds: float) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.server.setblocking(False)
        self.dvl_port = int(self.server.getsockname()[1])
        self.imu_port = free_port(socket.SOCK_DGRAM)
        self._arrivals = list(World(seconds).arrivals(imu=True))
        self._clients: list[socket.socket] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        for one in (self.server, *self._clients):
            one.close()

    def _run(self) -> None:
        begin = time.monotonic_ns()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as imu:
            for arrival_ns, source, data in self._arrivals:
                wait_s = (arrival_ns - START_NS - (time.monotonic_ns() - begin)) * 1e-9
                if self._stop.wait(max(wait_s, 0.0)):
                    return
                if source == 1:
                    imu.sendto(data, ("127.0.0.1", self.imu_port))
                else:
                    self._send(data)

    def _send(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            self._clients.append(self.server.accept()[0])
        for client in list(self._clients):
            try:
                client.sendall(data)
            except OSError:
                self._clients.remove(client)
                client.close()


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    """What an autopilot would listen on."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        yield one


def start(config: Path) -> subprocess.Popen[bytes]:
    """The command in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "bottomlock", "live", str(config)],
        stderr=subprocess.PIPE,
        env=dict(os.environ),
    )


def heard(listener: socket.socket, seconds: float) -> tuple[float, bytes]:
    """Seconds until the first datagram from now on, and what it is."""
    while select.select([listener], [], [], 0.0)[0]:
        listener.recv(65_536)
    begin = time.monotonic()
    assert select.select([listener], [], [], seconds)[0], f"nothing within {seconds} s"
    return time.monotonic() - begin, listener.recv(65_536)


@pytest.mark.slow
def test_killed_and_aiding_again(tmp_path: Path, listener: socket.socket) -> None:
    """From the checkpoint, with the next reset counter; both raw logs give the bits that were sent."""
    with Instruments(60.0) as instruments:
        text = NAVIGATION_TOML.format(
            dvl=f"tcp:127.0.0.1:{instruments.dvl_port}",
            imu=f"udpin:127.0.0.1:{instruments.imu_port}",
            to=f"udpout:127.0.0.1:{listener.getsockname()[1]}",
            format="waterlinked-json",
        ).replace('port = "probe"', 'port = "sentence"')
        text += '[log]\nfolder = "logs"\nflush_s = 0\n[checkpoint]\nfile = "last"\nevery_s = 0.2\n[health]\nport = 0\n'
        config = tmp_path / "rov.toml"
        config.write_text(text)
        first = start(config)
        try:
            assert b",OK,3,0," in heard(listener, 30.0)[1]
            time.sleep(1.0)
        finally:
            first.send_signal(signal.SIGKILL)
            first.communicate()
        second = start(config)
        try:
            seconds, data = heard(listener, 10.0)
            assert b",OK,3,1," in data
        finally:
            second.send_signal(signal.SIGTERM)
            words = second.communicate(timeout=10.0)[1].decode()
    assert second.returncode == 0
    assert "goes on from the checkpoint of" in words
    assert "state OK: beams determine the whole velocity" in words
    # The start of Python and its modules is most of it, and takes longer on a machine with other work.
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    assert seconds < 2.0 * max(load, 1.0), f"{seconds:.1f} s at a load of {load:.1f} a core"
    logs = sorted((tmp_path / "logs").glob("*.mcap"))
    assert len(logs) == 2
    for log in logs:
        result = replay_log(load_config(config), log)
        assert result.first_difference == ""
        assert result.sent > 0
