"""What a campaign costs beyond its kernel: threads, recording, Parquet, Python, memory, number of runs.

    python benches/campaign.py [--rounds 7] [--runs 96]

Rounds are interleaved; ratios are medians of the rounds' own. Times are on the clock, since threads share the work.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bottomlock import kernel, load_scenario, make_world, run_campaign
from bottomlock.conditions import schedule

ARMS = ["ins", "lc", "tc", "vb", "nsv", "plcf", "vhv", "elc"]


def seconds(work: Callable[[], object]) -> float:
    """Time on the clock."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def spread(values: list[float]) -> str:
    """Median, smallest and largest."""
    return f"{np.median(values):8.3g}   [{min(values):.3g}, {max(values):.3g}]"


def flight() -> dict[str, Any]:
    """The packaged straight trajectory, 250 s at 150 Hz, as the kernel takes it."""
    world = make_world(load_scenario("straight"))
    scenario, truth = world.scenario, world.truth()
    model = scenario.kernel_model(world.gravity_mps2)
    return {
        "geometry": world.geometry, "truth": truth.kernel_arrays(), "simulated": model, "assumed": model,
        "options": scenario.kernel_options(), "schedule": schedule(world, truth), "seed": 1, "trajectory_key": 2,
        "first_run": 0, "arms": ARMS,
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
    """The two numbers of `memory`."""
    work = flight()
    kernel.run_batch(**work, runs=1, threads=2)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    returned = kernel.run_batch(**work, runs=runs, threads=2)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(grown / 1024.0, sum(np.asarray(array).nbytes for array in returned.values()) / 2**20)


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--runs", type=int, default=96)
    options = parser.parse_args()
    work = flight()
    scenario = load_scenario("straight").with_overrides(runs=options.runs, arms=ARMS)

    def batch(runs: int, threads: int) -> Callable[[], object]:
        return lambda: kernel.run_batch(**work, runs=runs, threads=threads)

    def campaign() -> None:
        with tempfile.TemporaryDirectory() as folder:
            run_campaign([scenario], Path(folder) / "campaign", threads=2)

    parties = {
        "kernel, 1 thread": batch(options.runs, 1),
        "kernel, 2 threads": batch(options.runs, 2),
        "campaign, 2 threads": campaign,
        "kernel, 8 runs, 1 thread": batch(8, 1),
        "kernel, 32 runs, 1 thread": batch(32, 1),
    }
    times: dict[str, list[float]] = {name: [] for name in parties}
    for _ in range(options.rounds):
        for name, party in parties.items():
            times[name].append(seconds(party))
    print(f"{options.runs} runs of {len(ARMS)} arms over 37,500 steps; {options.rounds} rounds, s")
    for name, own in times.items():
        print(f"  {name:28}{spread(own)}")

    def ratio(name: str, above: str, below: str, factor: float = 1.0) -> None:
        pairs = zip(times[above], times[below], strict=True)
        print(f"  {name:52}{spread([factor * a / b for a, b in pairs])}")

    print("ratios")
    ratio("two threads against one", "kernel, 1 thread", "kernel, 2 threads")
    ratio("campaign's throughput against the kernel's", "kernel, 2 threads", "campaign, 2 threads")
    ratio("cost of a run, 8 against 32", "kernel, 8 runs, 1 thread", "kernel, 32 runs, 1 thread", 4.0)
    # A run costs the same in a small and a large batch but for what a batch costs by itself.
    large, small = (np.array(times[f"kernel, {n} runs, 1 thread"]) for n in (32, 8))
    print(
        f"  {'what a batch costs by itself, share of 8 runs':52}{spread(list((4 * small - large) / 3 / small))}"
    )
    big = [seconds(batch(512, 2)) for _ in range(2)]
    little = [16 * seconds(batch(32, 2)) for _ in range(4)]
    print(f"  {'cost of a run, 512 against 32, two threads':52}{np.median(big) / np.median(little):8.3g}")
    grown, returned = memory(512)
    print(f"512 runs: memory grows by {grown:.1f} MB, of which {returned:.1f} MB are the recorded outputs")
    return 0


if __name__ == "__main__":
    sys.exit(main())
