"""The composite log-likelihood of a candidate over all passes and horizons, with the priors of its parameters."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry, KernelError
from bottomlock.kernel.models import InitialState
from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.tune.likelihood import Part, Scores, derivatives, part_of, scores
from bottomlock.replay.tune.parameters import PRIOR_SD, STEP
from bottomlock.replay.tune.passes import METHODS, Group, Inputs, Pass, fly

WORST = 1e300
"""Value of a candidate whose filter ends in an error."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """Coordinates of the parameters, innovations, their scores, and the criterion; empty where the filter failed."""

    at: Floats
    groups: Sequence[Group]
    scores: Scores | None
    value: float


@dataclass(frozen=True, eq=False)
class Slopes:
    """Gradients (n, P) of the weighted scores and their expected squares (n, P, P) without weights.

    `gradient` (P,) and `information` (P, P) are of the whole criterion.
    """

    gradients: Floats
    squares: Floats
    gradient: Floats
    information: Floats


@dataclass(eq=False)
class Criterion:
    """Negative composite log-likelihood less the log-density of the prior, of a part of a recording.

    Attributes:
        geometry, start: of the recording.
        passes: over it.
        inputs: what a candidate changes, of the coordinates of its parameters.
        prior: (P,) mean of the coordinates; their 1 sigma is `PRIOR_SD`.
        executor: threads for the passes; the results do not depend on their number.
        from_ns: time before which nothing is scored.
        methods: whose predictions are scored, each alike.
        weights: (n,) of the innovations; every sensor and horizon counts alike.
        flown: number of passes so far.
    """

    geometry: BeamGeometry
    start: InitialState
    passes: Sequence[Pass]
    inputs: Callable[[Floats], Inputs]
    prior: Floats
    executor: Executor
    from_ns: int = 0
    methods: tuple[str, ...] = METHODS
    weights: Floats = field(default_factory=lambda: np.zeros(0))
    flown: int = 0

    def candidates(self, places: Sequence[Floats]) -> list[Candidate]:
        """Candidates at several places, flown side by side."""
        inputs = [self._inputs(one) for one in places]
        jobs = [(given, one) for given in inputs for one in self.passes]
        flown = list(self.executor.map(self._fly, jobs))
        self.flown += len(jobs)
        count = len(self.passes)
        return [self._candidate(one, flown[k * count : (k + 1) * count]) for k, one in enumerate(places)]

    def _inputs(self, at: Floats) -> Inputs | None:
        try:
            return self.inputs(at)
        except KernelError:
            return None

    def _fly(self, job: tuple[Inputs | None, Pass]) -> list[tuple[Group, Part]] | None:
        inputs, one = job
        if inputs is None:
            return None
        try:
            groups = fly(one, self.geometry, inputs, self.start, from_ns=self.from_ns, methods=self.methods)
        except KernelError:
            return None
        return [(group, part_of(group)) for group in groups]

    def _candidate(self, at: Floats, flown: Sequence[list[tuple[Group, Part]] | None]) -> Candidate:
        if any(one is None for one in flown):
            return Candidate(at, (), None, WORST)
        groups, parts = zip(*(pair for one in flown if one is not None for pair in one), strict=True)
        scored = scores(groups, parts)
        if not self.weights.size:
            self.weights = weights_of(scored)
        value = float(self.weights @ scored.value) if np.isfinite(scored.value).all() else WORST
        apart = (at - self.prior) / PRIOR_SD
        return Candidate(at, groups, scored, value + 0.5 * float(apart @ apart))

    def slopes(self, at: Candidate) -> Slopes:
        """The derivatives of the criterion at a candidate, by differences of the innovations.

        Raises:
            DataError: where the filter fails beside it.
        """
        assert at.scores is not None
        ahead = self._beside(at, STEP)
        each, squares = derivatives(at.groups, [one.groups for one in ahead], STEP, self.executor)
        gradient = self.weights[:, None] * each
        precision = PRIOR_SD**-2
        information = np.einsum("n,npq->pq", self.weights, squares) + precision * np.eye(len(at.at))
        return Slopes(gradient, squares, gradient.sum(axis=0) + precision * (at.at - self.prior), information)

    def _beside(self, at: Candidate, step: float) -> list[Candidate]:
        """The candidates a step away in one parameter each."""
        flown = self.candidates([at.at + row for row in step * np.eye(len(at.at))])
        for k, one in enumerate(flown, start=1):
            if one.scores is None:
                raise DataError(
                    f"the filter ends in an error where parameter {k} of {len(flown)} is {step:+g} from its "
                    "best value, at the edge of what it takes: replay the case and mend it first"
                )
        return flown


def weights_of(scored: Scores) -> Floats:
    """Weight (n,) of each innovation: every sensor and horizon counts as many innovations as the rarest has."""
    terms = scored.terms.values()
    least = min(int(term.sum()) for term in terms)
    weights = np.zeros(len(scored.value))
    for term in terms:
        weights[term] = least / term.sum()
    return weights


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
