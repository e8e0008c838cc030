"""The composite log-likelihood of a candidate over all passes and horizons, with the priors of its parameters."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry, KernelError
from bottomlock.kernel.models import InitialState
from bottomlock.recordings.streams import Floats
from bottomlock.replay.tune.likelihood import Part, Scores, central_derivatives, derivatives, part_of, scores
from bottomlock.replay.tune.parameters import STEP
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
    """Gradients (n, P) of the weighted scores, expected squares (n, P, P) without weights, and of all both.

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
        prior, prior_sd: (P,) mean and 1 sigma of the coordinates.
        executor: threads for the passes; the results do not depend on their number.
        done: called after each pass.
        from_ns: time before which nothing is scored.
        methods: whose predictions are scored, each alike.
        steps: (P,) of the derivatives, `STEP` by default.
        are_alike: whether every sensor and horizon counts alike, and not every innovation.
        is_central: whether the derivatives are by differences to both sides.
    """

    geometry: BeamGeometry
    start: InitialState
    passes: Sequence[Pass]
    inputs: Callable[[Floats], Inputs]
    prior: Floats
    prior_sd: Floats
    executor: Executor
    done: Callable[[], None] = lambda: None
    from_ns: int = 0
    methods: tuple[str, ...] = METHODS
    steps: Floats | None = None
    are_alike: bool = True
    is_central: bool = False
    weights: Floats = field(default_factory=lambda: np.zeros(0))

    def candidates(self, places: Sequence[Floats]) -> list[Candidate]:
        """Candidates at several places, flown side by side."""
        inputs = [self._inputs(one) for one in places]
        jobs = [(given, one) for given in inputs for one in self.passes]
        flown = list(self.executor.map(self._fly, jobs))
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
        finally:
            self.done()
        return [(group, part_of(group)) for group in groups]

    def _candidate(self, at: Floats, flown: Sequence[list[tuple[Group, Part]] | None]) -> Candidate:
        if any(one is None for one in flown):
            return Candidate(at, (), None, WORST)
        groups, parts = zip(*(pair for one in flown if one is not None for pair in one), strict=True)
        scored = scores(groups, parts)
        if not self.weights.size:
            self.weights = weights_of(scored) if self.are_alike else np.ones(len(scored.value))
        value = float(self.weights @ scored.value) if np.isfinite(scored.value).all() else WORST
        apart = (at - self.prior) / self.prior_sd
        return Candidate(at, groups, scored, value + 0.5 * float(apart @ apart))

    def slopes(self, at: Candidate) -> Slopes:
        """The derivatives of the criterion at a candidate, by differences of the innovations.

        Raises:
            DataError: where the filter fails beside it.
        """
        assert at.scores is not None
        steps = np.full(len(at.at), STEP) if self.steps is None else self.steps
        ahead = self._beside(at, steps)
        groups = [one.groups for one in ahead]
        if self.is_central:
            behind = self._beside(at, -steps)
            gradients = [
                (one.scores.value - other.scores.value) / (2.0 * step)
                for one, other, step in zip(ahead, behind, steps, strict=True)
                if one.scores is not None and other.scores is not None
            ]
            each = central_derivatives(
                at.groups, groups, [one.groups for one in behind], steps, np.stack(gradients, axis=1)
            )
        else:
            each = derivatives(at.groups, groups, steps, self.executor)
        gradient = self.weights[:, None] * each.gradient
        precision = self.prior_sd**-2
        information = definite(np.einsum("n,npq->pq", self.weights, each.information)) + np.diag(precision)
        return Slopes(
            gradient, each.square, gradient.sum(axis=0) + precision * (at.at - self.prior), information
        )

    def _beside(self, at: Candidate, steps: Floats) -> list[Candidate]:
        """The candidates a step away in one parameter each."""
        flown = self.candidates([at.at + step for step in np.diag(steps)])
        for k, one in enumerate(flown, start=1):
            if one.scores is None:
                raise DataError(
                    f"the filter ends in an error where parameter {k} of {len(flown)} is {steps[k - 1]:+g} from its "
                    "best value, at the edge of what it takes: replay the case and mend it first"
                )
        return flown


def definite(matrix: Floats) -> Floats:
    """The nearest positive semi-definite matrix: an estimate of no information may be below zero."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def weights_of(scored: Scores) -> Floats:
    """Weight (n,) of each innovation: every sensor and horizon counts as many innovations as the rarest has."""
    terms = scored.terms.values()
    least = min(int(term.sum()) for term in terms)
    weights = np.zeros(len(scored.value))
    for term in terms:
        weights[term] = least / term.sum()
    return weights
