"""Worker processes that run cases, watched: a case that takes too long is ended, one that ends its process is kept."""

from __future__ import annotations

import multiprocessing
import os
import resource
import signal
import time
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.sharedctypes import Synchronized
from typing import Any

from tests.attack.subjects import run_case
from tests.attack.trial import Trial

Run = Callable[[int, int, Trial], None]
"""Makes the calls of a case: seed, number of the case, where they are counted."""

CASES = 50
"""Cases of a task: many enough that messages cost nothing, few enough that progress moves."""

MEMORY_BYTES = 4 << 30
"""Address space of a worker: a call that asks for more must be refused, not take the machine's memory."""


@dataclass
class Outcome:
    """What the cases gave.

    Attributes:
        calls: calls by function.
        accepted: those that returned.
        faults: (case, line).
        slowest_s: the longest case.
    """

    calls: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    faults: list[tuple[int, str]] = field(default_factory=list)
    slowest_s: float = 0.0


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    running: Synchronized[int]
    since: Synchronized[float]
    task: tuple[int, int] | None = None


def attack(
    seed: int,
    calls: int,
    *,
    first: int = 0,
    jobs: int | None = None,
    limit_s: float = 10.0,
    run: Run = run_case,
    progress: Callable[[Outcome], None] | None = None,
) -> Outcome:
    """Runs cases from number `first` on until so many calls are made.

    A case over `limit_s`, or one that ends its process by a signal, is a fault; a new process goes on behind it. `run`
    makes the calls of a case.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.attack.subjects"])
    outcome = Outcome()
    workers = [_started(context, seed, run) for _ in range(jobs or os.cpu_count() or 1)]
    following = first
    redo: list[tuple[int, int]] = []
    try:
        while True:
            for worker in workers:
                if worker.task is None and (redo or sum(outcome.calls.values()) < calls):
                    worker.task = redo.pop() if redo else (following, following + CASES)
                    following = max(following, worker.task[1])
                    worker.pipe.send(worker.task)
            if all(worker.task is None for worker in workers):
                return outcome
            wait([worker.pipe for worker in workers if worker.task], timeout=0.2)
            for k, worker in enumerate(workers):
                rest = _heard(worker, outcome, limit_s)
                if rest is not None:
                    workers[k] = _started(context, seed, run)
                    redo += [rest] if rest[0] < rest[1] else []
            if progress is not None:
                progress(outcome)
    finally:
        for worker in workers:
            worker.process.kill()
            worker.process.join()


def _started(context: Any, seed: int, run: Run) -> _Worker:  # noqa: ANN401 - multiprocessing does not export the type
    ours, theirs = context.Pipe()
    running, since = context.Value("q", -1), context.Value("d", 0.0)
    process = context.Process(target=_work, args=(seed, run, theirs, running, since), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours, running, since)


def _heard(worker: _Worker, outcome: Outcome, limit_s: float) -> tuple[int, int] | None:
    """Takes in what a worker has sent; the cases left to a new one if it has ended or had to be ended."""
    if worker.task is None:
        return None
    try:
        while worker.task is not None and worker.pipe.poll():
            calls, accepted, faults, slowest_s, done = worker.pipe.recv()
            outcome.calls += calls
            outcome.accepted += accepted
            outcome.faults += faults
            outcome.slowest_s = max(outcome.slowest_s, slowest_s)
            worker.task = None if done else worker.task
    except (EOFError, ConnectionResetError):
        worker.process.join()
        code = worker.process.exitcode or 0
        name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        return _lost(worker, outcome, f"abort | the process ended by {name}")
    case, since = worker.running.value, worker.since.value
    if worker.task is None or case < 0 or time.monotonic() - since < limit_s:
        return None
    worker.process.kill()
    worker.process.join()
    return _lost(worker, outcome, f"hang | over {limit_s:g} s")


def _lost(worker: _Worker, outcome: Outcome, words: str) -> tuple[int, int]:
    case, (first, end) = worker.running.value, worker.task or (0, 0)
    outcome.faults.append((case, words))
    return max(case + 1, first), end


def _work(
    seed: int, run: Run, pipe: Connection, running: Synchronized[int], since: Synchronized[float]
) -> None:
    """Runs what the pipe asks for; `running` and `since` say what was being done if the process ends."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Traces of panics; the exception is reported.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    warnings.simplefilter("ignore")
    while True:
        try:
            first, end = pipe.recv()
        except EOFError:
            return
        for case in range(first, end):
            running.value = case
            since.value = began = time.monotonic()
            trial = Trial()
            run(seed, case, trial)
            faults = [(case, line) for line in trial.faults]
            taken_s = time.monotonic() - began
            pipe.send((trial.calls, trial.accepted, faults, taken_s, case == end - 1))
        running.value = -1
