"""Time from the `kill -9` of `bottomlock live` to the first message of its successor, state OK, from the checkpoint.

Usage: python -m benches.live_restart [--kills 10] [--busy 0]

A supervisor waits for the process and starts it again at once, as systemd or a container does with no delay. DVL
(10 Hz) and IMU (100 Hz) go on meanwhile, over loopback. `--busy N` runs N processes beside it that compute without end.
The start of the interpreter with numpy, which no program of this kind can do without, is stated for comparison.
"""

import argparse
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.live.processes import Instruments, heard, start

AIM_S = 2.0
_RUN_S = 0.7


def _compute() -> None:
    while True:
        sum(range(1000))


def restarts(kills: int) -> list[float]:
    """Seconds from each kill to the first message in state OK with the next reset counter."""
    found = []
    with (
        tempfile.TemporaryDirectory() as folder,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener,
        Instruments(20.0 + 8.0 * kills) as instruments,
    ):
        listener.bind(("127.0.0.1", 0))
        config = Path(folder) / "rov.toml"
        instruments.write_config(config, listener.getsockname()[1])
        running = start(config)
        try:
            assert b",OK,3,0," in heard(listener, 60.0)
            for k in range(kills):
                # Long enough for a checkpoint, and at another place between two pings each time.
                time.sleep(_RUN_S + 0.013 * k)
                began = time.monotonic()
                running.send_signal(signal.SIGKILL)
                running.communicate()
                running = start(config)
                data = heard(listener, 60.0)
                found.append(time.monotonic() - began)
                assert b",OK,3,%d," % (k + 1) in data, data
        finally:
            running.kill()
            running.communicate()
    return found


def interpreter_s(rounds: int = 5) -> float:
    """Median seconds of a process that imports numpy and nothing else."""
    found = []
    for _ in range(rounds):
        began = time.monotonic()
        subprocess.run([sys.executable, "-c", "import numpy"], check=True)
        found.append(time.monotonic() - began)
    return float(np.median(found))


def main() -> None:
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--busy", type=int, default=0)
    chosen = parser.parse_args()
    others = [multiprocessing.Process(target=_compute, daemon=True) for _ in range(chosen.busy)]
    for one in others:
        one.start()
    found = np.array(restarts(chosen.kills))
    interpreter = interpreter_s()
    for one in others:
        one.terminate()
    print(
        f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores, {chosen.busy} of it started here"
    )
    print(
        f"kill -9 to the first message in state OK, {len(found)} kills: median {np.median(found):.2f} s, "
        f"least {found.min():.2f} s, most {found.max():.2f} s (aim {AIM_S:g} s: "
        f"{'held' if found.max() < AIM_S else 'NOT held'}); python with numpy alone {interpreter:.2f} s"
    )


if __name__ == "__main__":
    main()
