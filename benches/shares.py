"""Where the time of a campaign goes, as time of all threads on cores.

    python benches/shares.py [--rounds 5] [--runs 96]

Parts of the kernel are differences of batches that leave something out (on one thread): the methods, the pings, the
samples. Parts of Python are timed one by one. The smallest of the rounds counts. The truth comes from the cache.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from campaign import METHODS, flight

from bottomlock import build_simulation, kernel, load_scenario, run_campaign
from bottomlock.campaign.aggregate import open_aggregate
from bottomlock.campaign.build import build_scenarios, build_simulations, true_paths
from bottomlock.campaign.chunk import run_chunk
from bottomlock.campaign.chunk_files import read_chunk, write_chunk
from bottomlock.campaign.directory import write_tables
from bottomlock.campaign.manifest import identity_of
from bottomlock.campaign.partition import Partition

STEPS = 37_500


def least(work: Callable[[], object], rounds: int) -> float:
    """The smallest time on cores, ms."""
    times = []
    for _ in range(rounds):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return 1e3 * min(times)


def of_kernel(runs: int, rounds: int) -> dict[str, float]:
    """Parts of a batch, ms."""
    work = flight()
    schedule = work["schedule"]
    last = {"sample_time_ns": schedule["sample_time_ns"][-1:]}
    deaf = {key: schedule[key][:0] for key in ("dvl_time_ns", "beam_valid")}

    def batch(changes: dict[str, object], methods: list[str] | None = None) -> float:
        these = work | {"schedule": schedule | changes, "methods": METHODS if methods is None else methods}
        return least(lambda: kernel.run_batch(**these, runs=runs, threads=1), rounds)

    noise = batch(last, [])
    prediction = batch(last | deaf) - batch(last | deaf, [])
    unrecorded, whole = batch(last), batch({})
    return {
        "noise": noise,
        "prediction": prediction,
        "measurements": unrecorded - noise - prediction,
        "recording": whole - unrecorded,
    }


def of_python(runs: int, rounds: int, kernel_ms: float) -> dict[str, float]:
    """Parts of a campaign outside the kernel, ms."""
    scenario = load_scenario("straight").with_overrides(runs=runs, methods=METHODS)
    simulations, partition = build_simulations([scenario]), Partition.of(scenario)
    (built,), identity = build_scenarios(simulations), identity_of(simulations)
    chunks = partition.chunks()
    results = [run_chunk(built, chunk, threads=1) for chunk in chunks]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)

        def write() -> None:
            for chunk, result in zip(chunks, results, strict=True):
                write_chunk(out, chunk, result, identity)

        def tables() -> None:
            with open_aggregate(out, [partition]) as aggregate:
                for chunk in chunks:
                    aggregate.add(chunk, read_chunk(out, chunk, partition, identity))
                write_tables(out, true_paths([built]), aggregate.tables())

        def whole() -> None:
            with tempfile.TemporaryDirectory() as other:
                run_campaign([scenario], Path(other) / "campaign", threads=1)

        parts = {
            "simulation: vehicle, trim, mission": least(lambda: build_simulation(scenario), rounds),
            "truth from the cache": least(built.simulation.truth, rounds),
            "frames of the chunks": least(
                lambda: [run_chunk(built, chunk, threads=1) for chunk in chunks], rounds
            )
            - kernel_ms,
            "Parquet of the chunks": least(write, rounds),
            "tables: reading, statistics, bootstrap": least(tables, rounds),
        }
        rest = least(whole, rounds) - kernel_ms - sum(parts.values())
    return parts | {"manifest, hashes, directories": rest}


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--runs", type=int, default=96)
    options = parser.parse_args()
    inside = of_kernel(options.runs, options.rounds)
    outside = of_python(options.runs, options.rounds, sum(inside.values()))
    whole = sum(inside.values()) + sum(outside.values())
    print(
        f"{options.runs} runs of {len(METHODS)} methods over {STEPS:,} steps: {whole / 1e3:.3f} s on cores\n"
    )
    print("| part | ms | share | µs per step of a run |\n|---|---|---|---|")
    for what, spent in (inside | outside).items():
        print(
            f"| {what} | {spent:.0f} | {100.0 * spent / whole:.1f} % | {1e3 * spent / options.runs / STEPS:.4f} |"
        )
    kernel_share = np.sum(list(inside.values())) / whole
    print(f"\nkernel, with noise and recording: {100.0 * kernel_share:.1f} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
