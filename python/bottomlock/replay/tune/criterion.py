"""The composite log-likelihood of a candidate over all passes and horizons, its best candidate, and the 1 sigma there.

Outliers count as in Huber's loss.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import polars as pl
from scipy.optimize import OptimizeResult, minimize
from scipy.stats import chi2

from bottomlock.errors import DataError
from bottomlock.kernel import BeamGeometry, KernelError
from bottomlock.kernel.models import InitialState
from bottomlock.recordings.streams import Floats
from bottomlock.replay.tune.parameters import PRIOR_SD, STEP
from bottomlock.replay.tune.passes import METHODS, Group, Inputs, Pass, fly

WORST = 1e300
"""Value of a candidate whose filter ends in an error."""
TAIL = 1e-3
"""Probability beyond which an innovation squared counts as an outlier."""
TERM = ("sensor", "horizon")
"""Columns of scores that name a term of the criterion: every one counts alike."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """Coordinates of the parameters, innovations, their scores, and the criterion; empty where the filter failed."""

    at: Floats
    groups: Sequence[Group]
    scores: pl.DataFrame | None
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
        weights: (n,) of the innovations; every sensor and horizon counts as many innovations as the rarest has.
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
        flown = list(self.executor.map(self._fly, [(at, one) for at in places for one in self.passes]))
        self.flown += len(flown)
        count = len(self.passes)
        return [self._candidate(at, flown[k * count : (k + 1) * count]) for k, at in enumerate(places)]

    def _fly(self, job: tuple[Floats, Pass]) -> list[Group] | None:
        at, one = job
        try:
            inputs = self.inputs(at)
            return fly(one, self.geometry, inputs, self.start, from_ns=self.from_ns, methods=self.methods)
        except KernelError:
            return None

    def _candidate(self, at: Floats, flown: Sequence[list[Group] | None]) -> Candidate:
        groups = [group for one in flown for group in one or ()]
        try:
            scores = None if None in flown else scored(groups)
        except np.linalg.LinAlgError:
            scores = None
        if scores is None:
            return Candidate(at, (), None, WORST)
        if not self.weights.size:
            count = scores.select(pl.len().over(TERM)).to_series().to_numpy()
            self.weights = count.min() / count
        total = float(self.weights @ scores["value"].to_numpy())
        apart = (at - self.prior) / PRIOR_SD
        value = total + 0.5 * float(apart @ apart) if np.isfinite(total) else WORST
        return Candidate(at, groups, scores, value)

    def slopes(self, at: Candidate) -> Slopes:
        """The derivatives of the criterion at a candidate, by those a step away in one parameter each.

        Raises:
            DataError: where the filter fails beside it.
        """
        beside = self.candidates([at.at + row for row in STEP * np.eye(len(at.at))])
        for k, one in enumerate(beside, start=1):
            if one.scores is None:
                raise DataError(
                    f"the filter ends in an error where parameter {k} of {len(beside)} is {STEP:+g} from its "
                    "best value, at the edge of what it takes: replay the case and mend it first"
                )
        parts = [_derivatives(group, [one.groups[k] for one in beside]) for k, group in enumerate(at.groups)]
        each, squares = (np.concatenate(part) for part in zip(*parts, strict=True))
        gradients = self.weights[:, None] * each
        precision = PRIOR_SD**-2
        information = np.einsum("n,npq->pq", self.weights, squares) + precision * np.eye(len(at.at))
        return Slopes(
            gradients, squares, gradients.sum(axis=0) + precision * (at.at - self.prior), information
        )


def scored(groups: Sequence[Group]) -> pl.DataFrame:
    """A row an innovation: sensor, horizon, time_ns, rows, NIS and value, its negative log-likelihood."""
    parts = []
    for group in groups:
        rows = group.residual.shape[1]
        nis = (white_residuals(group) ** 2).sum(axis=1)
        _, log_det = np.linalg.slogdet(group.covariance)
        value = 0.5 * (_loss(nis, rows) + rows * np.log(2.0 * np.pi) + log_det)
        content = {"sensor": [group.sensor] * len(nis), "horizon": group.horizon, "time_ns": group.time_ns}
        parts.append(pl.DataFrame(content | {"rows": [rows] * len(nis), "nis": nis, "value": value}))
    return pl.concat(parts)


def white_residuals(group: Group) -> Floats:
    """Innovations (n, k) of unit covariance, independent where the model is right.

    Raises:
        LinAlgError: for a covariance that is none.
    """
    factor = np.linalg.cholesky(group.covariance)
    return np.asarray(np.linalg.solve(factor, group.residual[..., None])[..., 0])


def _loss(nis: Floats, rows: int) -> Floats:
    """The NIS; beyond the bound that good innovations exceed once in 1/TAIL, its tangent in the root of the NIS."""
    bound = chi2.isf(TAIL, rows)
    return np.where(nis <= bound, nis, 2.0 * np.sqrt(bound * np.maximum(nis, bound)) - bound)


def _derivatives(group: Group, beside: Sequence[Group]) -> tuple[Floats, Floats]:
    """Gradient (n, P) of each innovation's value and its Fisher information (n, P, P), the gradient's expected square.

    Args:
        group: (n, k) innovations.
        beside: the same a `STEP` away in each parameter.
    """
    dz = np.stack([one.residual - group.residual for one in beside]) / STEP
    ds = np.stack([one.covariance - group.covariance for one in beside]) / STEP
    inverse = np.linalg.inv(group.covariance)
    scaled = np.einsum("nij,nj->ni", inverse, group.residual)
    nis = np.einsum("ni,ni->n", scaled, group.residual)
    weight = np.sqrt(np.minimum(1.0, chi2.isf(TAIL, group.residual.shape[1]) / np.maximum(nis, 1e-300)))
    relative = np.einsum("nij,pnjk->pnik", inverse, ds)
    fit = np.einsum("ni,pni->np", scaled, dz) - 0.5 * np.einsum("ni,pnij,nj->np", scaled, ds, scaled)
    mean = np.einsum("pni,nij,qnj->npq", dz, inverse, dz, optimize=True)
    return (
        weight[:, None] * fit + 0.5 * np.einsum("pnii->np", relative),
        mean + 0.5 * np.einsum("pnij,qnji->npq", relative, relative, optimize=True),
    )


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
    criterion: Criterion, starts: Sequence[Floats], progress: Callable[[int], None] = lambda _: None
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


def uncertainty(criterion: Criterion, found: Found, block_s: float) -> Floats:
    """1 sigma (P,) of the coordinates that were found.

    The information H is that of the criterion. Innovations of one step are independent where the model is right, so
    their gradients have the covariance Σ w² I; those over outages overlap, and several methods predict the same
    measurements. Where the recording has enough blocks, and their gradients scatter more than that, the model is not
    right and their scatter counts.
    """
    scores, weight = found.best.scores, criterion.weights
    assert scores is not None  # it is the best
    overlap = np.where(scores["horizon"].to_numpy() > 0, OVERLAP, 1.0)
    own = np.einsum("n,npq->pq", len(criterion.methods) * overlap * weight**2, found.slopes.squares)
    prior = PRIOR_SD**-2 * np.eye(len(own))
    inverse = np.linalg.inv(found.slopes.information)
    sums = block_sums(scores, found.slopes.gradients, block_s)
    scatter = sums - sums.mean(axis=0)
    covariances = [own, *([scatter.T @ scatter] if len(sums) >= BLOCKS else [])]
    sds = [np.sqrt(np.diag(inverse @ (one + prior) @ inverse)) for one in covariances]
    return np.asarray(np.max(sds, axis=0))


def block_sums(scores: pl.DataFrame, values: Floats, block_s: float) -> Floats:
    """(b, ...) sums of values (n, ...) over blocks of time; the last, incomplete one belongs to the one before it."""
    since_s = (scores["time_ns"].to_numpy() - scores["time_ns"].min()) * 1e-9
    sums = np.zeros((max(1, int(since_s.max() // block_s)), *values.shape[1:]))
    np.add.at(sums, np.minimum(since_s // block_s, len(sums) - 1).astype(np.intp), values)
    return sums
