"""The search: Fisher scoring in the logarithms of the parameters, damped as Levenberg and Marquardt do."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bottomlock.errors import DataError
from bottomlock.replay.streams import Floats
from bottomlock.replay.tune.criterion import WORST, Candidate, Criterion, Slopes

ITERATIONS = 30
LARGEST_STEP = np.log(4.0)
"""Largest change of a parameter's logarithm in an iteration."""
SETTLED = 0.05
"""Gain of the criterion below which the search ends."""
DAMPINGS = ((0.1, 1.0), (10.0, 100.0), (1e3, 1e4), (1e5, 1e6))
"""Factors on the damping, tried in pairs until one gains."""


@dataclass(frozen=True, eq=False)
class Found:
    """The best candidate, the derivatives there, the number of iterations, and whether the search came to an end."""

    best: Candidate
    slopes: Slopes
    iterations: int
    has_settled: bool


def search(
    criterion: Criterion,
    starts: Sequence[Floats],
    progress: Callable[[int, Candidate], None] = lambda *_: None,
) -> Found:
    """The best candidate from the best of some starts on.

    Raises:
        DataError: where the filter fails at every start.
    """
    best = min(criterion.candidates(starts), key=lambda one: one.value)
    if best.value >= WORST:
        raise DataError(
            "the filter ends in an error with every noise tried: replay the case and mend it first"
        )
    damping, has_settled, iteration = 1e-3, False, 0
    slopes = criterion.slopes(best)
    while iteration < ITERATIONS and not has_settled:
        iteration += 1
        progress(iteration, best)
        tried: list[Candidate] = []
        for factors in DAMPINGS:
            steps = [_step(slopes, damping * factor) for factor in factors]
            tried = criterion.candidates([best.logs + step for step in steps])
            if min(one.value for one in tried) < best.value:
                break
        better = min(tried, key=lambda one: one.value)
        gain, change = best.value - better.value, np.abs(better.logs - best.logs).max()
        if gain <= 0.0:
            has_settled = True
            break
        damping = max(damping * factors[tried.index(better)], 1e-4)
        best = better
        has_settled = bool(gain < SETTLED and change < 0.05)
        slopes = criterion.slopes(best)
    return Found(best, slopes, iteration, has_settled)


def _step(slopes: Slopes, damping: float) -> Floats:
    damped = slopes.information + damping * np.diag(np.diag(slopes.information))
    step = -np.linalg.solve(damped, slopes.gradient)
    return np.asarray(step * min(1.0, LARGEST_STEP / max(np.abs(step).max(), 1e-300)))
