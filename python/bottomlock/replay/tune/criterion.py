"""The composite log-likelihood of a candidate over all passes and horizons, with the priors of its parameters."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

import numpy as np

from bottomlock.kernel import BeamGeometry, KernelError
from bottomlock.models import InitialState
from bottomlock.replay.streams import Floats
from bottomlock.replay.tune.likelihood import Scores, derivatives, scores
from bottomlock.replay.tune.passes import Group, Inputs, Pass, fly

STEP = 0.02
"""Step of the derivatives, in the natural logarithm of a parameter."""
WORST = 1e300
"""Value of a candidate whose filter ends in an error."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """Logarithms of the parameters, innovations, their scores, and the criterion; empty where the filter failed."""

    logs: Floats
    groups: Sequence[Group]
    scores: Scores | None
    value: float


@dataclass(frozen=True, eq=False)
class Slopes:
    """Gradients (n, P) of the weighted scores, expected Fisher matrices (n, P, P) without weights, and both of all."""

    gradients: Floats
    fisher_matrices: Floats
    gradient: Floats
    information: Floats


@dataclass(eq=False)
class Criterion:
    """Negative composite log-likelihood less the log-density of the prior, of a part of a recording.

    Attributes:
        geometry, start: of the recording.
        passes: over it.
        inputs: what a candidate changes, of the logarithms of its parameters.
        prior, prior_sd: (P,) mean and 1 sigma of the logarithms.
        executor: threads for the passes; the results do not depend on their number.
        done: called after each pass.
        from_ns: time before which nothing is scored.
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
    weights: Floats = field(default_factory=lambda: np.zeros(0))

    def candidates(self, logs: Sequence[Floats]) -> list[Candidate]:
        """Candidates at several places, flown side by side."""
        inputs = [self._inputs(one) for one in logs]
        jobs = [(given, one) for given in inputs for one in self.passes]
        groups = list(self.executor.map(self._fly, jobs))
        count = len(self.passes)
        return [self._candidate(one, groups[k * count : (k + 1) * count]) for k, one in enumerate(logs)]

    def _inputs(self, logs: Floats) -> Inputs | None:
        try:
            return self.inputs(logs)
        except KernelError:
            return None

    def _fly(self, job: tuple[Inputs | None, Pass]) -> list[Group] | None:
        inputs, one = job
        try:
            return (
                None if inputs is None else fly(one, self.geometry, inputs, self.start, from_ns=self.from_ns)
            )
        except KernelError:
            return None
        finally:
            self.done()

    def _candidate(self, logs: Floats, parts: Sequence[list[Group] | None]) -> Candidate:
        if any(part is None for part in parts):
            return Candidate(logs, (), None, WORST)
        groups = [group for part in parts if part is not None for group in part]
        scored = scores(groups)
        if not self.weights.size:
            self.weights = weights_of(scored)
        value = float(self.weights @ scored.value) if np.isfinite(scored.value).all() else WORST
        apart = (logs - self.prior) / self.prior_sd
        return Candidate(logs, groups, scored, value + 0.5 * float(apart @ apart))

    def slopes(self, at: Candidate) -> Slopes:
        """The derivatives of the criterion at a candidate, by forward differences of the innovations."""
        assert at.scores is not None
        count = len(at.logs)
        stepped = self.candidates([at.logs + STEP * unit for unit in np.eye(count)])
        each = derivatives(at.groups, [one.groups for one in stepped], np.full(count, STEP))
        gradient = self.weights[:, None] * each.gradient
        precision = self.prior_sd**-2
        information = np.einsum("n,npq->pq", self.weights, each.information) + np.diag(precision)
        return Slopes(
            gradient,
            each.information,
            gradient.sum(axis=0) + precision * (at.logs - self.prior),
            information,
        )


def weights_of(scored: Scores) -> Floats:
    """Weight (n,) of each innovation: every sensor and horizon counts as many innovations as the rarest has."""
    terms = scored.terms.values()
    least = min(int(term.sum()) for term in terms)
    weights = np.zeros(len(scored.value))
    for term in terms:
        weights[term] = least / term.sum()
    return weights
