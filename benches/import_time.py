"""What `import bottomlock.kernel` costs beside `import numpy`, which it needs; `import bottomlock` alone needs neither.

    python benches/import_time.py [--rounds 15]

Each in a process of its own, in turn; times are those that the process had on a core. Ratios are medians of the rounds'
own.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys

import numpy as np


def seconds(code: str) -> float:
    """Time on a core of a process that runs some code."""
    process = subprocess.Popen([sys.executable, "-c", code])
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, code)
    return usage.ru_utime + usage.ru_stime


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    codes = {"nothing": "pass", "numpy": "import numpy", "bottomlock": "import bottomlock.kernel"}
    for code in codes.values():
        seconds(code)
    times = {name: np.empty(options.rounds) for name in codes}
    for k in range(options.rounds):
        for name, code in codes.items():
            times[name][k] = seconds(code)
    ratio = times["bottomlock"] / times["numpy"]
    net = (times["bottomlock"] - times["nothing"]) / (times["numpy"] - times["nothing"])
    for name, own in times.items():
        print(f"{name:12}{1e3 * np.median(own):8.1f} ms   [{1e3 * own.min():.1f}, {1e3 * own.max():.1f}]")
    print(
        f"bottomlock.kernel / numpy {np.median(ratio):.3f} [{ratio.min():.3f}, {ratio.max():.3f}]; "
        f"less the interpreter's own time {np.median(net):.3f}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
