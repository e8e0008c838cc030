"""What a campaign costs beyond its kernel: threads, recording, Parquet, Python, memory, number of runs.

    python benches/campaign.py [--rounds 7] [--runs 96]

Rounds are interleaved; ratios are medians of the rounds' own. Where other work shares the machine, the time that all
threads had on cores says more than the clock. The truth comes from the cache, but for the first campaign on a machine.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock import build_simulation, kernel, load_scenario, run_campaign
from bottomlock.simulation.measurement_schedule import measurement_schedule

METHODS = ["ins", "lc", "tc", "vb", "nsv", "plcf", "vhv", "elc"]


def seconds(work: Callable[[], object]) -> tuple[float, float]:
    """Time on the clock, and time of all threads on cores."""
    begin, begin_cores = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - begin, time.process_time() - begin_cores


def spread(values: list[float]) -> str:
    """Median, smallest and largest."""
    return f"{np.median(values):8.3g}   [{min(values):.3g}, {max(values):.3g}]"


def flight() -> dict[str, Any]:
    """The packaged straight trajectory, 250 s at 150 Hz, as the kernel takes it."""
    simulation = build_simulation(load_scenario("straight"))
    scenario, truth = simulation.scenario, simulation.truth()
    model = scenario.kernel_model(simulation.gravity_mps2)
    return {
        "geometry": simulation.geometry, "truth": truth.kernel_arrays(), "simulated": model, "assumed": model,
        "options": scenario.kernel_options(), "schedule": measurement_schedule(simulation, truth), "seed": 1,
        "trajectory_key": 2, "first_run": 0, "methods": METHODS,
    }  # fmt: skip


def memory(runs: int) -> tuple[float, float]:
    """Growth of the largest resident set by a batch, and the size of what it returns, MB; in a process of its own."""
    code = "import sys; sys.path.insert(0, sys.argv[1]); import campaign; campaign.print_memory(int(sys.argv[2]))"
    here = str(Path(__file__).resolve().parent)
    answer = subprocess.run(
        [sys.executable, "-c", code, here, str(runs)], check=True, capture_output=True, text=True
    )
    grown, returned = answer.stdout.split()
    return float(grown), float(returned)


def print_memory(runs: int) -> None:
    """The two numbers of `memory`; the largest resident set of Linux is since the last reset."""
    work = flight()
    kernel.run_batch(**work, runs=8, threads=2)
    before = resident_mb("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    returned = kernel.run_batch(**work, runs=runs, threads=2)
    grown = resident_mb("VmHWM") - before
    print(grown, sum(np.asarray(array).nbytes for array in returned.values()) / 2**20)


def resident_mb(which: str) -> float:
    """A line of `/proc/self/status`."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) / 1024.0 for line in lines if line.startswith(which + ":"))


def measure(
    candidates: dict[str, Callable[[], object]], rounds: int
) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Times of each candidate on the clock and on cores, in interleaved rounds."""
    times: dict[str, list[float]] = {name: [] for name in candidates}
    busy: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(rounds):
        for name, candidate in candidates.items():
            clock, cores = seconds(candidate)
            times[name].append(clock)
            busy[name].append(cores)
    return times, busy


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--runs", type=int, default=96)
    options = parser.parse_args()
    work = flight()
    scenario = load_scenario("straight").with_overrides(runs=options.runs, methods=METHODS)

    def batch(runs: int, threads: int) -> Callable[[], object]:
        return lambda: kernel.run_batch(**work, runs=runs, threads=threads)

    def campaign() -> None:
        with tempfile.TemporaryDirectory() as folder:
            run_campaign([scenario], Path(folder) / "campaign", threads=2)

    noise = flight() | {"methods": []}
    candidates = {
        "kernel, 1 thread": batch(options.runs, 1),
        "kernel, 2 threads": batch(options.runs, 2),
        "noise alone, 2 threads": lambda: kernel.run_batch(**noise, runs=options.runs, threads=2),
        "campaign, 2 threads": campaign,
        "kernel, 8 runs, 1 thread": batch(8, 1),
        "kernel, 32 runs, 1 thread": batch(32, 1),
        "kernel, no runs": batch(0, 1),
    }
    times, busy = measure(candidates, options.rounds)
    print(
        f"{options.runs} runs of {len(METHODS)} methods over 37,500 steps; {options.rounds} rounds; s on the clock"
    )
    for name, own in times.items():
        print(f"  {name:28}{spread(own)}    on cores {spread(busy[name])}")

    def ratio(name: str, above: list[float], below: list[float]) -> None:
        print(f"  {name:56}{spread([a / b for a, b in zip(above, below, strict=True)])}")

    kernels, campaigns = times["kernel, 2 threads"], times["campaign, 2 threads"]
    filters = [a - b for a, b in zip(kernels, times["noise alone, 2 threads"], strict=True)]
    filters_busy = [
        a - b for a, b in zip(busy["kernel, 2 threads"], busy["noise alone, 2 threads"], strict=True)
    ]
    print("ratios")
    ratio("two threads against one", times["kernel, 1 thread"], kernels)
    ratio("campaign's throughput against the kernel's", kernels, campaigns)
    ratio("the same, by time on cores", busy["kernel, 2 threads"], busy["campaign, 2 threads"])
    ratio("against the kernel's without noise", filters, campaigns)
    ratio("the same, by time on cores", filters_busy, busy["campaign, 2 threads"])
    eight = busy["kernel, 8 runs, 1 thread"]
    ratio("run of 8 against run of 32, on cores", [4.0 * t for t in eight], busy["kernel, 32 runs, 1 thread"])
    ratio("a call from Python by itself against 8 runs", times["kernel, no runs"], eight)
    big = [seconds(batch(512, 2))[1] for _ in range(2)]
    little = [16.0 * seconds(batch(32, 2))[1] for _ in range(6)]
    print(f"  {'run of 512 against run of 32, two threads, on cores':56}{min(big) / min(little):8.3g}")
    grown, returned = memory(512)
    print(f"512 runs: memory grows by {grown:.1f} MB, of which {returned:.1f} MB are the recorded outputs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
