"""What the tests of `bottomlock live` as a process share: instruments that go on, the process, what it sends."""

from __future__ import annotations

import contextlib
import itertools
import os
import select
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Self

from tests.live.world import START_NS, World, text_of

_NEXT = itertools.count(os.getpid() * 37)


def free_port(kind: socket.SocketKind) -> int:
    """A port that nobody uses. It lies below those that the system gives to who asks for any, so it stays free."""
    while True:
        port = 12_000 + next(_NEXT) % 18_000
        with socket.socket(socket.AF_INET, kind) as one, contextlib.suppress(OSError):
            one.bind(("127.0.0.1", port))
            return port


class Instruments:
    """DVL and IMU that go on, in real time, whatever happens to who listens. Use as a context manager."""

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

    def write_config(self, path: Path, to_port: int) -> None:
        """A configuration of mode navigation with these instruments, a raw log and a checkpoint every 0.2 s."""
        text = text_of(
            "navigation",
            dvl=f"tcp:127.0.0.1:{self.dvl_port}",
            imu=f"udpin:127.0.0.1:{self.imu_port}",
            to=f"udpout:127.0.0.1:{to_port}",
        ).replace('port = "probe"', 'port = "sentence"')
        text += '[log]\nfolder = "logs"\nflush_s = 0\n[health]\nport = 0\n'
        text += '[checkpoint]\nfile = "last"\nevery_s = 0.2\nmax_age_s = 60\n'
        path.write_text(text)


def start(config: Path) -> subprocess.Popen[bytes]:
    """The command in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "bottomlock", "live", str(config)],
        stderr=subprocess.PIPE,
        env=dict(os.environ),
    )


def heard(listener: socket.socket, seconds: float) -> bytes:
    """The first datagram from now on; fails after so many seconds."""
    while select.select([listener], [], [], 0.0)[0]:
        listener.recv(65_536)
    assert select.select([listener], [], [], seconds)[0], f"nothing within {seconds} s"
    return listener.recv(65_536)
