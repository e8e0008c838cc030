"""`bottomlock live-demo` as a user runs it: its lines, and Ctrl-C in a process of its own."""

from __future__ import annotations

import contextlib
import re
import signal
import socket
import subprocess
import sys

import pytest

from tests.cli.calls import command

pytest.importorskip("pymavlink", reason="needs pymavlink (extra mavlink)")


def test_beams_go_and_come_back_and_the_listener_goes_on_hearing() -> None:
    """Every state in its order at the listener; every message that is sent is received."""
    done = command("live-demo", "--seconds", "20", "--speed", "5")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert re.search(r"^health page http://127\.0\.0\.1:\d+/$", done.stdout, re.MULTILINE)
    assert "states: OK → PARTIAL → COASTING → OK\n" in done.stdout
    received, sent = re.search(r"(\d+) ODOMETRY messages received of (\d+) sent", done.stdout).groups()  # type: ignore[union-attr]
    assert received == sent
    # At most ten a second from 3 s on, and never two more than 0.15 s apart.
    assert 110 <= int(received) <= 180
    lines = re.findall(
        r"^ +[\d.]+ s  (\S+) +beams (.{7})  (.*) m/s  \d+ messages$", done.stdout, re.MULTILINE
    )
    assert ("COASTING", "- - - -") in [(state, beams) for state, beams, _ in lines]
    for name in ("OK", "PARTIAL", "COASTING"):
        error, sd = re.search(rf"{name}: velocity error ([\d.]+) .* 1σ sent ([\d.]+)", done.stdout).groups()  # type: ignore[union-attr]
        assert float(error) < 3.0 * float(sd)


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("watched", [False, True])
def test_ctrl_c_ends_it_with_the_summary(watched: bool) -> None:
    """No traceback, exit code 0, at once, also while a browser has the page open."""
    running = subprocess.Popen(
        [sys.executable, "-m", "bottomlock", "live-demo", "--speed", "10"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert running.stdout is not None
    while "health page" not in (line := running.stdout.readline()):
        pass
    with contextlib.ExitStack() as stack:
        if watched:
            port = int(line.rstrip("/\n").rpartition(":")[2])
            page = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=10))
            page.sendall(b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            while b"data:" not in page.recv(65_536):
                pass
        running.send_signal(signal.SIGINT)
        out, errors = running.communicate(timeout=20)
    assert running.returncode == 0
    assert errors == ""
    assert "ODOMETRY messages received" in out
