"""Random calls of the kernel, a short run of `make attack`; and that the attack sees what it looks for."""

from __future__ import annotations

import os
import time
import warnings
from collections import Counter

import numpy as np
import pytest

from bottomlock.kernel import KernelError
from tests.attack.__main__ import kinds
from tests.attack.pool import CASES as CASES_OF_A_PROCESS
from tests.attack.pool import attack
from tests.attack.subjects import run_case
from tests.attack.trial import Trial
from tests.attack.values import Arguments

CASES = 350
SEED = 16


@pytest.mark.filterwarnings("ignore")
def test_random_calls_of_every_function_are_answered_or_refused_in_one_line() -> None:
    """Some two thousand calls: no panic, nothing that is not finite, no refused push that leaves a trace."""
    calls: Counter[str] = Counter()
    faults = []
    for case in range(CASES):
        trial = Trial()
        run_case(SEED, case, trial)
        calls += trial.calls
        faults += [(case, line) for line in trial.faults]
    assert kinds(faults) == []
    assert len(calls) > 25, "every function has its turn"


@pytest.mark.deep
@pytest.mark.slow
def test_a_hundred_thousand_random_calls() -> None:
    """As above, watched from outside: no abort and no call over ten seconds."""
    outcome = attack(SEED, 100_000)
    assert kinds(outcome.faults) == []
    refused = [name for name, number in outcome.calls.items() if outcome.accepted[name] < 0.15 * number]
    assert refused == [], "an attack whose calls are all refused at the door tests nothing"


def _dangerous(seed: int, case: int, trial: Trial) -> None:
    """What the pool has to survive, by number of the case."""
    assert seed == SEED
    trial.call("harmless", int, Arguments({}))
    if case == 3:
        os.abort()
    if case == 60:
        time.sleep(60.0)


@pytest.mark.long
def test_an_abort_and_a_hang_are_kept_and_the_others_go_on() -> None:
    """Every other case is run, and counted once."""
    outcome = attack(SEED, 101, jobs=1, limit_s=1.0, run="tests.attack.test_attack:_dangerous")
    assert sorted(outcome.faults) == [(3, "abort | the process ended with code -6"), (60, "hang | over 1 s")]
    assert outcome.calls["harmless"] == CASES_OF_A_PROCESS - 2


def _refuses(**arguments: object) -> None:
    raise KernelError(f"{len(arguments)} arguments\nand a second line")


def _breaks() -> None:
    raise ZeroDivisionError("division by zero")


def test_what_a_call_may_not_do_is_a_fault() -> None:
    """An error of two lines, an error that is no refusal, an acceptance of what is wrong, a NaN, a bad covariance."""
    trial = Trial()
    trial.call("refuses", _refuses, Arguments({"a": 1}))
    trial.call("breaks", _breaks, Arguments({}))
    trial.call("accepts", int, Arguments({}, wrong=("x: no number",)))
    trial.call("valid", _refuses, Arguments({}), valid=True)
    trial.finite(
        "f",
        {"x": np.array([0.0, np.nan]), "nested": {"y": float("inf")}, "lacking": np.nan},
        may_lack=("lacking",),
    )
    trial.covariance("p", np.array([[1.0, 0.5], [0.2, 1.0]]))
    trial.covariance("p", np.diag([1.0, -1e-9]))
    trial.covariance("p", np.diag([1.0, 2.0]))
    assert [line.split(" | ")[0] for line in trial.faults] == [
        "refuses", "breaks", "accepts", "valid", "valid", "f", "f", "p", "p",
    ]  # fmt: skip


def test_a_case_is_made_again_from_its_number() -> None:
    """Same seed and number, same calls, whatever was run before."""
    told: list[list[str]] = []
    for _ in range(2):
        words: list[str] = []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run_case(SEED, 11, Trial(words.append))
        told.append([line for line in words if " at 0x" not in line])
    assert told[0] == told[1]
    assert told[0]
