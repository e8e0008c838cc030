"""Ctrl-C ends work in the kernel within half a second, and a command in one line."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from bottomlock import kernel
from tests.analytic import batch_along
from tests.cli.calls import shortened

MOST_S = 0.5
"""Time from the signal to the exception, s."""

LONG = """
import signal, sys, time
import numpy as np
from bottomlock import kernel
from tests.analytic import batch_along

asked = []
def ask(*_):
    asked.append(time.perf_counter())
    raise KeyboardInterrupt
signal.signal(signal.SIGINT, ask)
work = batch_along(100.0)
print("begins", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print(time.perf_counter() - asked[0])
else:
    print("went on to its end")
"""

BATCH = "kernel.run_batch(**work, methods=list(kernel.METHODS), runs=4000, threads={threads})"
REPLAY = """
    times = work["truth"]["time_ns"]
    none = np.empty(0, np.int64)
    imu = {"imu_time_ns": times, "omega_p_radps": work["truth"]["omega_p_radps"],
           "force_p_mps2": work["truth"]["force_p_mps2"]}
    dvl = {"dvl_time_ns": none, "beam_velocity_mps": np.empty((0, 4)), "beam_valid": np.empty((0, 4), bool)}
    start = {"time_ns": 0} | {
        key: work["truth"][key][0] for key in ("position_t_m", "attitude_t_p", "velocity_p_mps")
    }
    kernel.replay_log(work["geometry"], work["assumed"], work["options"], ["tc"] * 400, imu | dvl, start,
                      sample_time_ns=times[::150], smooth=True)
"""


def interrupted(code: str) -> tuple[int, str, str]:
    """Starts a program, sends it SIGINT half a second after it has begun, and returns how it ended."""
    program = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
    )
    assert program.stdout is not None
    assert program.stdout.readline() == "begins\n"
    time.sleep(0.5)
    program.send_signal(signal.SIGINT)
    stdout, stderr = program.communicate(timeout=60)
    return program.returncode, stdout, stderr


@pytest.mark.first_cases(1)
@pytest.mark.parametrize("call", [BATCH.format(threads=1), BATCH.format(threads=2), REPLAY])
def test_a_long_call_ends_with_the_signal(call: str) -> None:
    """Minutes of work end within half a second of the signal, on one thread and on two."""
    code, stdout, stderr = interrupted(LONG.format(call=call.strip()))
    assert code == 0, stderr
    assert float(stdout) < MOST_S


def test_another_thread_can_end_a_batch() -> None:
    """As the campaign does, whose kernel works on a thread that no signal reaches."""
    work, stop = batch_along(100.0), threading.Event()
    threading.Timer(0.2, stop.set).start()
    with pytest.raises(kernel.KernelError, match="interrupted: the caller asked for an early end"):
        kernel.run_batch(**work, methods=list(kernel.METHODS), runs=4000, threads=1, stop=stop)


def test_an_event_that_is_not_set_changes_no_bit() -> None:
    """The work looks at the event and does nothing else."""
    work = batch_along(4.0)
    plain = kernel.run_batch(**work, methods=["tc"], runs=2, threads=1)
    watched = kernel.run_batch(**work, methods=["tc"], runs=2, threads=1, stop=threading.Event())
    assert all(np.array_equal(plain[key], watched[key], equal_nan=True) for key in plain)  # type: ignore[literal-required]


def test_a_campaign_ends_with_the_signal(tmp_path: Path) -> None:
    """The command ends soon and says how to resume."""
    scenario = str(shortened("straight", tmp_path / "s.toml"))
    call = ["run", scenario, "--runs", "100000", "--threads", "1", "--out", "o"]
    command = subprocess.Popen(
        [sys.executable, "-m", "bottomlock", *call], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    while not (tmp_path / "o" / "chunks").exists() and command.poll() is None:
        time.sleep(0.01)
    time.sleep(0.2)
    command.send_signal(signal.SIGINT)
    # Of the minutes that its runs take.
    _, stderr = command.communicate(timeout=60)
    assert command.returncode == 130
    assert stderr.splitlines()[-1] == "interrupted; finished chunks are kept in o: the same command resumes"


@pytest.mark.first_cases(2)
@pytest.mark.parametrize("after_s", [0.0, 0.3, 0.1, 0.6])
def test_a_command_that_starts_ends_without_a_traceback(after_s: float, tmp_path: Path) -> None:
    """Wherever its imports are, once the interpreter has come to the package."""
    log = tmp_path / "stderr.txt"
    words = ["-X", "importtime", "-m", "bottomlock", "run", "straight", "--runs", "1000000", "--out", "o"]
    with log.open("w") as errors_file:
        command = subprocess.Popen([sys.executable, *words], stderr=errors_file, cwd=tmp_path)
    while "bottomlock.errors" not in log.read_text():
        time.sleep(0.01)
    time.sleep(after_s)
    command.send_signal(signal.SIGINT)
    assert command.wait(timeout=60) == 130
    stderr = log.read_text()
    assert "Traceback" not in stderr
    assert "interrupted" in stderr.splitlines()[-1]


def test_an_interrupt_that_python_ignores_comes_again(tmp_path: Path) -> None:
    """As in the callback that drops the lock of an imported module: 2 of 900 commands went on."""
    program = """
import _thread, time, weakref
import bottomlock.cli.app as app
from bottomlock.__main__ import main

class Dropped: pass

def run():
    dropped = Dropped()
    held = weakref.ref(dropped, lambda _: _thread.interrupt_main() or sum(range(9)))
    del dropped
    for _ in range(50):
        time.sleep(0.1)
    print("went on")

app.main = run
main()
"""
    (tmp_path / "ignored.py").write_text(program, encoding="utf-8")
    command = subprocess.run(
        [sys.executable, "-m", "ignored"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (command.returncode, command.stdout) == (130, "")
    assert command.stderr == "bottomlock: interrupted\n"


@pytest.mark.parametrize(("cause", "code"), [("KeyboardInterrupt", 130), ("ValueError", 1)])
def test_an_interrupt_that_a_library_wraps_is_one(cause: str, code: int) -> None:
    """An error made of it while modules are imported ends as it does; any other error is shown."""
    program = (
        "import bottomlock.cli.app as app, bottomlock.__main__ as start\n"
        "def main():\n"
        "    try:\n"
        f"        raise {cause}\n"
        "    except BaseException as error:\n"
        "        raise ImportError('cannot import') from error\n"
        "app.main = main\n"
        "start.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert ("Traceback" in done.stderr) == (code == 1)
