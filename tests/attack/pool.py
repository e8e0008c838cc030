"""Random calls in processes of their own: a case that takes too long is ended, one that ends its process is kept."""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import warnings
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

from tests.attack.trial import Trial

CASES = 400
"""Cases of a process: many enough that its start costs little."""
MEMORY_BYTES = 4 << 30
"""Address space of a process: a call that asks for more must be refused, not take the machine's memory."""


@dataclass
class Outcome:
    """What the cases gave: calls by function, those that returned, and (case, line) of each fault."""

    calls: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    faults: list[tuple[int, str]] = field(default_factory=list)

    def add(self, other: Outcome) -> None:
        """Takes another one in."""
        self.calls += other.calls
        self.accepted += other.accepted
        self.faults += other.faults


def attack(
    seed: int,
    calls: int,
    *,
    first: int = 0,
    jobs: int | None = None,
    limit_s: float = 10.0,
    run: str = "tests.attack.subjects:run_case",
) -> Outcome:
    """Runs cases from number `first` on until so many calls are made.

    A case over `limit_s`, or one that ends its process, is a fault. `run` names what makes the calls of a case: seed,
    number of the case, where they are counted.
    """
    outcome, jobs = Outcome(), jobs or os.cpu_count() or 1
    with ThreadPoolExecutor(jobs) as threads:
        while sum(outcome.calls.values()) < calls:
            tasks = [(first + CASES * k, first + CASES * (k + 1)) for k in range(jobs)]
            first = tasks[-1][1]
            for found in threads.map(lambda task: _watched(seed, *task, limit_s, run), tasks):
                outcome.add(found)
    return outcome


def _watched(seed: int, first: int, end: int, limit_s: float, run: str) -> Outcome:
    """Cases in a process; behind one that ends it, in the next."""
    outcome = Outcome()
    while first < end:
        command = [sys.executable, "-m", "tests.attack.pool", run, *map(str, (limit_s, seed, first, end))]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        for line in done.stdout.splitlines():
            calls, accepted, faults = json.loads(line)
            outcome.add(Outcome(Counter(calls), Counter(accepted), [(first, fault) for fault in faults]))
            first += 1
        if done.returncode == -signal.SIGALRM:
            outcome.faults.append((first, f"hang | over {limit_s:g} s"))
        elif done.returncode:
            outcome.faults.append((first, f"abort | the process ended with code {done.returncode}"))
        first += done.returncode != 0
    return outcome


def main(run: str, limit_s: float, seed: int, first: int, end: int) -> None:
    """Runs cases in this process and prints what each gave, as a line of JSON; a case over the limit ends it."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    module, _, name = run.partition(":")
    make = getattr(importlib.import_module(module), name)
    for case in range(first, end):
        signal.setitimer(signal.ITIMER_REAL, limit_s)
        trial = Trial()
        make(seed, case, trial)
        sys.stdout.write(json.dumps([trial.calls, trial.accepted, trial.faults]) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), *map(int, sys.argv[3:]))
