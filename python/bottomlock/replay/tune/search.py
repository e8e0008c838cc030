"""The search: scipy's trust region in the logarithms of the parameters, the Fisher information for the Hessian."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from bottomlock.errors import DataError
from bottomlock.recordings.streams import Floats
from bottomlock.replay.tune.criterion import WORST, Candidate, Criterion, Slopes

ITERATIONS = 30
TRUST_RADIUS = {"initial_trust_radius": 1.0, "max_trust_radius": 4.0}
"""Change of the logarithms within which the quadratic model of the criterion is taken for right."""
SETTLED = 0.05
"""Gain of the criterion still to be had by that model, below which the search ends."""


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
        progress: called after each iteration with its number.

    Raises:
        DataError: where the filter fails at every start.
    """
    start = min(criterion.candidates(starts), key=lambda one: one.value)
    if start.value >= WORST:
        raise DataError(
            "the filter ends in an error with every noise tried: replay the case and mend it first"
        )

    @lru_cache(maxsize=2)
    def candidate(at: bytes) -> Candidate:
        return criterion.candidates([np.frombuffer(at)])[0]

    @lru_cache(maxsize=1)
    def slopes(at: bytes) -> Slopes:
        return criterion.slopes(candidate(at))

    iteration = 0

    def end_where_settled(intermediate_result: OptimizeResult) -> None:
        nonlocal iteration
        iteration += 1
        progress(iteration)
        if _gain_left(slopes(intermediate_result.x.tobytes())) < SETTLED:
            raise StopIteration

    result = minimize(
        lambda at: candidate(at.tobytes()).value, start.at, method="trust-exact",
        jac=lambda at: slopes(at.tobytes()).gradient, hess=lambda at: slopes(at.tobytes()).information,
        callback=end_where_settled, options={"maxiter": ITERATIONS, **TRUST_RADIUS},
    )  # fmt: skip
    at = result.x.tobytes()
    return Found(candidate(at), slopes(at), iteration, _gain_left(slopes(at)) < SETTLED)


def _gain_left(slopes: Slopes) -> float:
    """What the quadratic model of the criterion still gains by its full step."""
    return float(0.5 * slopes.gradient @ np.linalg.solve(slopes.information, slopes.gradient))
