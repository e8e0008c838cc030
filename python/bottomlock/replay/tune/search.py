"""The search: a trust region with the Fisher information for the Hessian, and the σ of what it finds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from bottomlock.errors import DataError
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.tune.criterion import WORST, Candidate, Criterion, Slopes
from bottomlock.replay.tune.parameters import PRIOR_SD

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


OVERLAP = 3.0
"""Predictions over outages that share noise, in the place of one: neighbouring passes, and horizons of one outage."""
BLOCKS = 12
"""Fewest blocks of a recording from which the scatter of their gradients is taken."""
DETERMINED = 0.5
"""Part of the prior's 1 sigma below which a parameter counts as determined by the recording."""


def uncertainty(criterion: Criterion, found: Found, block_s: float) -> Floats:
    """1 sigma (P,) of the coordinates that were found.

    The information H is that of the criterion. Innovations of one step are independent where the model is right, so
    their gradients have the covariance Σ w² I; those over outages overlap, and several methods predict the same
    measurements. Where the recording has enough blocks, and their gradients scatter more than that, the model is not
    right and their scatter counts.
    """
    scored = found.best.scores
    assert scored is not None
    weight = criterion.weights
    own = (
        found.slopes.squares
        * (len(criterion.methods) * weight * np.where(scored.horizon > 0, OVERLAP, 1.0) * weight)[
            :, None, None
        ]
    )
    prior = PRIOR_SD**-2 * np.eye(len(found.best.at))
    inverse = np.asarray(np.linalg.inv(found.slopes.information))
    sd = _sd(inverse, own.sum(axis=0) + prior)
    blocks = _block_sums(found.slopes.gradients, scored.time_ns, block_s)
    if len(blocks) >= BLOCKS:
        scatter = blocks - blocks.mean(axis=0)
        sd = np.maximum(sd, _sd(inverse, scatter.T @ scatter + prior))
    return sd


def _sd(inverse: Floats, covariance: Floats) -> Floats:
    return np.asarray(np.sqrt(np.diag(inverse @ covariance @ inverse)))


def _block_sums(gradient: Floats, time_ns: Times, block_s: float) -> Floats:
    """Sums of the gradients over blocks of time; the last, incomplete one belongs to the one before it."""
    block = ((time_ns - time_ns.min()) * 1e-9 // block_s).astype(np.intp)
    count = max(1, int((time_ns.max() - time_ns.min()) * 1e-9 // block_s))
    sums = np.zeros((count, gradient.shape[1]))
    np.add.at(sums, np.minimum(block, count - 1), gradient)
    return sums
