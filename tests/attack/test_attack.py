"""Random calls of the kernel; a case is made again by `run_case(SEED, case, Trial())`."""

from collections import Counter

import pytest

from tests.attack.subjects import run_case
from tests.attack.trial import Trial

SEED = 16


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("cases", [350, pytest.param(17_500, marks=[pytest.mark.deep, pytest.mark.slow])])
def test_random_calls_of_every_function_are_answered_or_refused_in_one_line(cases: int) -> None:
    """Some six calls a case: no panic, nothing that is not finite, no refused push that leaves a trace."""
    calls: Counter[str] = Counter()
    accepted: Counter[str] = Counter()
    faults = []
    for case in range(cases):
        trial = Trial()
        run_case(SEED, case, trial)
        calls += trial.calls
        accepted += trial.accepted
        faults += [(case, line) for line in trial.faults]
    assert faults == []
    assert len(calls) > 25, "every function has its turn"
    refused = [name for name, number in calls.items() if number > 50 and accepted[name] < 0.15 * number]
    assert refused == [], "an attack whose calls are all refused at the door tests nothing"
