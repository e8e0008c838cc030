"""The composite log-likelihood of a candidate over all passes and horizons, with the priors of its parameters."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry, KernelError
from bottomlock.kernel.models import InitialState
from bottomlock.recordings.streams import Floats
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
