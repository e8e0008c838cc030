"""Clients and bytes in great number against a running `bottomlock live`.

    python -m tests.attack.live_floods [SECONDS]

A DVL over a port that listens, an IMU, the health page, raw log and checkpoint, and a listener that counts the
messages. Every phase takes SECONDS (20): nothing else, 500 connections to the page that ask nothing and are renewed,
short connections to page and DVL, requests of the page, and three kinds of garbage on the DVL's port. Ends with exit
code 1 where a phase sends less than nine tenths of what is sent without company, or is silent for half a second.
"""

from __future__ import annotations

import contextlib
import itertools
import re
import select
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.live.processes import Instruments, free_port, start
from tests.live.world import NAVIGATION_TOML

Act = Callable[[], None]
GARBAGE = {
    "lines of two letters": b"ab\n" * 20_000,
    "empty JSON": b"{}\n" * 20_000,
    "velocity reports without content": b'{"type":"velocity"}\n' * 3_000,
}
LEAST_SHARE, LONGEST_SILENCE_S = 0.9, 0.5


def connected(port: int) -> socket.socket:
    """A connection that never waits."""
    one = socket.socket()
    one.settimeout(0.0)
    one.connect_ex(("127.0.0.1", port))
    return one


@contextlib.contextmanager
def relayed(instruments: Instruments, port: int) -> Iterator[None]:
    """Carries the DVL's bytes to a port that listens, again wherever it is sent away."""
    stop = threading.Event()

    def run() -> None:
        source = socket.create_connection(("127.0.0.1", instruments.dvl_port))
        source.settimeout(0.2)
        target: socket.socket | None = None
        while not stop.is_set():
            with contextlib.suppress(TimeoutError):
                data = source.recv(65_536)
                try:
                    target = target or socket.create_connection(("127.0.0.1", port), 1.0)
                    target.sendall(data)
                except OSError:
                    target = None
        source.close()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


Phase = Callable[[], contextlib.AbstractContextManager[Act]]


@contextlib.contextmanager
def nothing() -> Iterator[Act]:
    """No company."""
    yield lambda: None


@contextlib.contextmanager
def idle(port: int) -> Iterator[Act]:
    """Connections that ask nothing, the oldest replaced."""
    held: list[socket.socket] = []

    def act() -> None:
        if len(held) == 500:
            held.pop(0).close()
        held.append(connected(port))

    yield act
    for one in held:
        one.close()


@contextlib.contextmanager
def short(*ports: int) -> Iterator[Act]:
    """Connections that end at once."""
    turns = itertools.cycle(ports)
    yield lambda: connected(next(turns)).close()


@contextlib.contextmanager
def requests(port: int) -> Iterator[Act]:
    """Eight clients that ask again and again."""
    stop = threading.Event()

    def ask() -> None:
        while not stop.is_set():
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0) as one:
                one.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
                one.recv(65_536)

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for one in threads:
        one.start()
    yield lambda: None
    stop.set()
    for one in threads:
        one.join()


@contextlib.contextmanager
def garbage(port: int, data: bytes) -> Iterator[Act]:
    """Bytes that are no report, as many as are taken."""
    with socket.create_connection(("127.0.0.1", port)) as one:
        one.settimeout(0.0)

        def act() -> None:
            with contextlib.suppress(OSError):
                one.send(data)

        yield act


def phases(page: int, dvl: int) -> Iterator[tuple[str, Phase]]:
    """Name of each, and what is done again and again while it lasts."""
    yield "no company", nothing
    yield "500 idle connections to the page, renewed", partial(idle, page)
    yield "short connections", partial(short, page, dvl)
    yield "requests of the page", partial(requests, page)
    for name, data in GARBAGE.items():
        yield f"garbage: {name}", partial(garbage, dvl, data)
    yield "no company again", nothing


def flown(act: Act, listener: socket.socket, seconds: float) -> tuple[int, float, int]:
    """Messages in the time, the longest silence in s, and how often `act` was done."""
    end = time.monotonic() + seconds
    last, gap, count, acts = time.monotonic(), 0.0, 0, 0
    while time.monotonic() < end:
        act()
        acts += 1
        while select.select([listener], [], [], 0.001)[0]:
            listener.recv(65_536)
            now = time.monotonic()
            last, gap, count = now, max(gap, now - last), count + 1
    return count, max(gap, time.monotonic() - last), acts


def main(seconds: float) -> int:
    """Prints a line for each phase."""
    page, dvl = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_STREAM)
    failed = False
    with (
        tempfile.TemporaryDirectory() as folder,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener,
    ):
        listener.bind(("127.0.0.1", 0))
        with Instruments(seconds * 10 + 30) as instruments:
            path = Path(folder) / "live.toml"
            text = NAVIGATION_TOML.format(
                dvl=f"tcpin:127.0.0.1:{dvl}",
                imu=f"udpin:127.0.0.1:{instruments.imu_port}",
                to=f"udpout:127.0.0.1:{listener.getsockname()[1]}",
                format="waterlinked-json",
            )
            text = text.replace('port = "probe"', 'port = "sentence"')
            path.write_text(
                f'{text}[log]\nfolder = "{folder}"\n[checkpoint]\nfile = "{folder}/last"\n[health]\nport = {page}\n'
            )
            process = start(path)
            try:
                with relayed(instruments, dvl):
                    if not select.select([listener], [], [], 30.0)[0]:
                        print("nothing was sent within 30 s", file=sys.stderr)
                        return 1
                    usual = 0
                    for name, phase in phases(page, dvl):
                        with phase() as act:
                            count, gap, acts = flown(act, listener, seconds)
                        usual = usual or count
                        bad = count < LEAST_SHARE * usual or gap > LONGEST_SILENCE_S
                        failed |= bad
                        print(
                            f"{name:48} {count / seconds:6.1f} messages/s, longest silence {gap:.3f} s, "
                            f"{acts:,} times{'  FAILED' if bad else ''}"
                        )
                    descriptors = len(list(Path(f"/proc/{process.pid}/fd").iterdir()))
                    print(f"descriptors at the end: {descriptors}")
            finally:
                process.terminate()
                words = process.communicate(timeout=20)[1].decode()
                print(
                    f"{len(words):,} characters on the terminal, {len(re.findall('Traceback', words))} tracebacks"
                )
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0))
