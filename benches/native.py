"""What a build for this very machine gains over the ordinary one, which finds the vectors at run time.

    python benches/native.py [--rounds 9] [--seconds 250]

Builds example `compare_filters` twice, the second time with `-C target-cpu=native` into a folder of its own, and times
both in turn on the readings of `compare.py`. Times are those that the thread had on a core; ratios are medians of the
rounds' own. Both must end with the same covariance, bit for bit.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import compare
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
LINES = {
    "one run, event by event": "one",
    "event by event, 10 Hz": "one_10hz",
    "8 methods side by side": "methods 8",
    "8 methods, 10 Hz": "methods_10hz 8",
    "32 runs side by side": "many 32",
    "32 runs, 10 Hz": "many_10hz 32",
}


def build(folder: Path, flags: str) -> Path:
    """The candidates, built into a folder."""
    environment = os.environ | {"CARGO_TARGET_DIR": str(folder), "RUSTFLAGS": flags}
    command = ["cargo", "build", "--release", "--locked", "--example", "compare_filters"]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)
    return folder / "release" / "examples" / "compare_filters"


def main() -> int:
    """Build, measure and print; 1 where the covariances differ."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=int, default=250)
    options = parser.parse_args()
    builds = {
        "ordinary": build(ROOT / "target", ""),
        "native": build(ROOT / "target" / "native", "-C target-cpu=native"),
    }
    readings = compare.Readings.make(options.seconds)
    candidates: dict[tuple[str, str], compare.Candidate] = {}
    timings: dict[tuple[str, str], list[compare.Timing]] = {}
    processes: list[compare.Rust] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, path in builds.items():
            own = Path(folder) / name
            own.mkdir()
            rust = compare.Rust(readings, own, path)
            processes.append(rust)
            candidates |= {(name, what): rust.candidate(line) for what, line in LINES.items()}
        for _ in range(options.rounds):
            for rust in processes:
                rust.renew()
            for key, candidate in candidates.items():
                timings.setdefault(key, []).append(candidate())
    print("us per run-step, ordinary; native; ratio: median [smallest, largest]")
    same = True
    for what in LINES:
        ordinary, native = timings["ordinary", what], timings["native", what]
        ratios = [a.step_us / b.step_us for a, b in zip(ordinary, native, strict=True)]
        steps = [f"{np.median([timing.step_us for timing in own]):8.4f}" for own in (ordinary, native)]
        print(f"  {what:22}{steps[0]}{steps[1]}{compare.spread(ratios)}")
        same &= np.array_equal(ordinary[0].covariance, native[0].covariance)
    if not same:
        print("native: the two builds end with different covariances", file=sys.stderr)
    return int(not same)


if __name__ == "__main__":
    sys.exit(main())
