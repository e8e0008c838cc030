"""The search: Fisher scoring in the coordinates of the parameters, damped as Levenberg and Marquardt do."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bottomlock.errors import DataError
from bottomlock.recordings.streams import Floats
from bottomlock.replay.tune.criterion import WORST, Candidate, Criterion, Slopes

ITERATIONS = 30
LARGEST_STEP = np.log(4.0)
"""Largest change of a parameter's coordinate in an iteration."""
SETTLED = 0.05
"""Gain of the criterion below which the search ends."""
TRIALS = (
    ((0.1, 1.0), (0.1, 2.5)),
    ((10.0, 1.0), (100.0, 1.0)),
    ((1e3, 1.0), (1e4, 1.0)),
    ((1e5, 1.0), (1e6, 1.0)),
)
"""Factors on the damping and on the step, tried in pairs until one gains.

A noise that is too large comes down by a factor of e^½ a step of Fisher scoring, however much too large it is, so a
longer step is tried as well."""


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
    progress: Callable[[int], None] = lambda _: None,
) -> Found:
    """The best candidate from the best of some starts on.

    Args:
        criterion: the criterion.
        starts: coordinates (P,) of each.
        progress: called before each iteration with its number.

    Raises:
        DataError: where the filter fails at every start.
    """
    best = min(criterion.candidates(starts), key=lambda one: one.value)
    if best.value >= WORST:
        raise DataError(
            "the filter ends in an error with every noise tried: replay the case and mend it first"
        )
    damping, iteration, has_settled = 1e-3, 0, False
    while True:
        progress(iteration)
        slopes = criterion.slopes(best)
        if has_settled or iteration == ITERATIONS:
            return Found(best, slopes, iteration, has_settled)
        better, damping = _stepped(criterion, best, slopes, damping)
        gain, change = best.value - better.value, np.abs(better.at - best.at).max()
        if gain <= 0.0:
            return Found(best, slopes, iteration + 1, has_settled=True)
        best, iteration, has_settled = better, iteration + 1, bool(gain < SETTLED and change < 0.05)


def _stepped(
    criterion: Criterion, best: Candidate, slopes: Slopes, damping: float
) -> tuple[Candidate, float]:
    """The best candidate of the first pair of steps that gains, or of the last one, and the damping to go on with."""
    tried: list[Candidate] = []
    for factors in TRIALS:
        steps = [stretch * _step(slopes, damping * factor) for factor, stretch in factors]
        tried = criterion.candidates([best.at + _bounded(step) for step in steps])
        if min(one.value for one in tried) < best.value:
            break
    better = min(tried, key=lambda one: one.value)
    return better, max(damping * factors[tried.index(better)][0], 1e-4)


def _step(slopes: Slopes, damping: float) -> Floats:
    damped = slopes.information + damping * np.diag(np.diag(slopes.information))
    return np.asarray(-np.linalg.solve(damped, slopes.gradient))


def _bounded(step: Floats) -> Floats:
    return np.asarray(step * min(1.0, LARGEST_STEP / max(np.abs(step).max(), 1e-300)))
