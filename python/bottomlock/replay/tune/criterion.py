"""The composite log-likelihood of a candidate over all passes and horizons, and its 1 sigma where it is best.

Outliers count as in Huber's loss.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import polars as pl
from scipy.optimize import OptimizeResult, minimize
from scipy.stats import chi2

from bottomlock.errors import DataError
from bottomlock.kernel import KernelError
from bottomlock.recordings.streams import Floats
from bottomlock.replay.tune.parameters import PRIOR_SD, Parameter
from bottomlock.replay.tune.passes import Pass, Recording

Progress = Callable[[float, int], None]
TAIL = 1e-3
"""Probability beyond which an innovation squared counts as an outlier."""
STEP = 0.005
"""Step of the derivatives, in the natural logarithm of a parameter."""
TERM = ("sensor", "horizon_s")
"""Columns that name a term of the criterion: every one counts alike."""
SETTLED = 0.05
"""Gain of the criterion still to be had by its quadratic model, below which the search ends."""
TRUST = {"maxiter": 30, "initial_trust_radius": 1.0, "max_trust_radius": 4.0}
"""Change of the logarithms within which the quadratic model of the criterion is taken for right."""
FAILED = 1e300
"""Value of a candidate whose filter ends in an error, there or a step beside it."""
OVERLAP = 3.0
"""Predictions over outages that share noise, in the place of one: neighbouring passes, and horizons of one outage."""
BLOCKS = 12
"""Fewest blocks of a recording from which the scatter of their gradients is taken."""


class Innovations:
    """Innovations (n, k) of several passes from a time on, beyond the rows of each 0 with unit variance.

    Attributes:
        table: sensor, horizon_s (0 for one step), time_ns, rows, NIS, and value, its negative log-likelihood.
        residual, covariance: (n, k) and (n, k, k).
        whitening: (n, k, k) with it the residuals have unit covariance where the model is right.
    """

    def __init__(self, parts: Sequence[Mapping[str, Any]], from_ns: int) -> None:
        width, sizes = max(part["residual"].shape[1] for part in parts), [len(part["rows"]) for part in parts]
        columns = {
            name: np.concatenate([part[name] for part in parts]) for name in ("horizon_s", "time_ns", "rows")
        }
        columns["sensor"] = np.repeat([part["sensor"] for part in parts], sizes)
        kept = columns["time_ns"] >= from_ns
        residual, covariance = (
            np.concatenate([_padded(part[name], width) for part in parts])[kept]
            for name in ("residual", "covariance")
        )
        self.residual = np.nan_to_num(residual)
        self.covariance = np.where(np.isnan(covariance), np.eye(width), covariance)
        self.whitening = np.linalg.inv(np.linalg.cholesky(self.covariance))
        rows = columns["rows"][kept]
        nis = ((self.whitening @ self.residual[..., None])[..., 0] ** 2).sum(axis=1)
        # Beyond the bound that good innovations exceed once in 1/TAIL its tangent in the root of the NIS.
        bound = chi2.isf(TAIL, np.arange(width + 1))[rows]
        loss = np.where(nis <= bound, nis, 2.0 * np.sqrt(bound * np.maximum(nis, bound)) - bound)
        log_det = -2.0 * np.log(np.diagonal(self.whitening, axis1=1, axis2=2)).sum(axis=1)
        scores = {"nis": nis, "value": 0.5 * (loss + rows * np.log(2.0 * np.pi) + log_det)}
        self.table = pl.DataFrame({name: column[kept] for name, column in columns.items()} | scores)

    def information(self, beside: Sequence["Innovations"]) -> Floats:
        """(n, P, P) Fisher information of each, by those a `STEP` away in each of P parameters."""
        left, right = self.whitening, self.whitening.swapaxes(1, 2)
        mean = [(left @ (one.residual - self.residual)[..., None])[..., 0] / STEP for one in beside]
        spread = [left @ (one.covariance - self.covariance) @ right / STEP for one in beside]
        dz, ds = np.stack(mean, 1), np.stack(spread, 1).reshape(len(left), len(beside), -1)
        return np.asarray(dz @ dz.swapaxes(1, 2) + 0.5 * ds @ ds.swapaxes(1, 2))


def _padded(array: Floats, width: int) -> Floats:
    """An array (n, k, ...) whose axes but the first are as long as `width`, with NaN."""
    more = [(0, 0), *[(0, width - array.shape[1])] * (array.ndim - 1)]
    return np.pad(array, more, constant_values=np.nan)


@dataclass(frozen=True, eq=False)
class Expansion:
    """The criterion about a place: its value and innovations, None where the filter fails; its quadratic model.

    `gradients` (n, P) are of the weighted values, `squares` (n, P, P) their expected squares without weights;
    `gradient` (P,) and `information` (P, P) are of the whole criterion.
    """

    at: Floats
    value: float
    innovations: Innovations | None
    gradients: Floats
    squares: Floats
    gradient: Floats
    information: Floats

    @property
    def gain_left(self) -> float:
        """What the quadratic model of the criterion still gains by its full step."""
        return float(0.5 * self.gradient @ np.linalg.solve(self.information, self.gradient))


@dataclass(eq=False)
class Criterion:
    """Negative composite log-likelihood less the log-density of the prior, of a part of a recording.

    Attributes:
        recording, passes: that part, and the passes over it.
        noise: the P settings that are searched, in their logarithms; the prior is about their starts.
        executor: threads for the passes; the results do not depend on their number.
        from_ns: time before which nothing is scored.
        weights: (n,) of the innovations; every sensor and horizon counts as many innovations as the rarest has.
        flown: number of passes so far.
        left: part of the work before its search, which does half of it: another one may follow.
    """

    recording: Recording
    passes: Sequence[Pass]
    noise: Sequence[Parameter]
    executor: Executor
    from_ns: int = 0
    flown: int = 0
    left: float = 1.0
    weights: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def start(self) -> Floats:
        """(P,) coordinates of the case."""
        return np.log([one.start for one in self.noise])

    def innovations(self, candidates: Sequence[Mapping[str, float]]) -> list[Innovations | None]:
        """Those of several candidates, flown side by side; None where the filter fails."""
        jobs = [(one, values) for values in candidates for one in self.passes]
        flown, count = list(self.executor.map(self._fly, jobs)), len(self.passes)
        self.flown += len(jobs)
        return [self._together(flown[k : k + count]) for k in range(0, len(jobs), count)]

    def _fly(self, job: tuple[Pass, Mapping[str, float]]) -> list[dict[str, Any]] | None:
        try:
            return self.recording.innovations(*job)
        except KernelError:
            return None

    def _together(self, flown: Sequence[list[dict[str, Any]] | None]) -> Innovations | None:
        try:
            found = (
                None
                if None in flown
                else Innovations([part for one in flown for part in one or ()], self.from_ns)
            )
        except np.linalg.LinAlgError:
            return None
        if found is not None and not self.weights.size:
            count = found.table.select(pl.len().over(TERM)).to_series().to_numpy()
            self.weights = count.min() / count
        return found

    def at(self, places: Sequence[Floats]) -> list[tuple[float, Innovations | None]]:
        """The value of the criterion at several places, and the innovations there."""
        keys = [one.key for one in self.noise]
        flown = self.innovations([dict(zip(keys, np.exp(at).tolist(), strict=True)) for at in places])
        prior = [0.5 * float(np.sum(((at - self.start) / PRIOR_SD) ** 2)) for at in places]
        values = [
            FAILED if one is None else float(self.weights @ one.table["value"].to_numpy()) + more
            for one, more in zip(flown, prior, strict=True)
        ]
        return list(zip(np.nan_to_num(values, nan=FAILED, posinf=FAILED).tolist(), flown, strict=True))

    def expand(self, at: Floats) -> Expansion:
        """The criterion about a place, by candidates there and a step away in one parameter each."""
        count, precision = len(at), PRIOR_SD**-2
        (value, here), *others = self.at([at, *(at + STEP * np.eye(count))])
        beside = [one for _, one in others if one is not None]
        if here is None or value >= FAILED or len(beside) < count:
            nothing = np.zeros((0, count, count))
            return Expansion(at, FAILED, None, nothing[:, 0], nothing, np.zeros(count), np.eye(count))
        values = [one.table["value"].to_numpy() for one in (here, *beside)]
        gradients = self.weights[:, None] * (np.stack(values[1:], 1) - values[0][:, None]) / STEP
        squares = here.information(beside)
        information = np.einsum("n,npq->pq", self.weights, squares) + precision * np.eye(count)
        gradient = gradients.sum(axis=0) + precision * (at - self.start)
        return Expansion(at, value, here, gradients, squares, gradient, information)

    def best(self, starts: Sequence[Floats], progress: Progress) -> Expansion:
        """The best place, searched from the best of some starts on.

        Args:
            starts: coordinates (P,) of each.
            progress: called after each iteration with the part that is done, and the number of passes.

        Raises:
            DataError: where the filter fails at every start.
        """
        expand = lru_cache(maxsize=4)(lambda at: self.expand(np.frombuffer(at)))
        values = [value for value, _ in self.at(starts)]
        begun = expand(starts[int(np.argmin(values))].tobytes())
        if begun.innovations is None:
            raise DataError(
                "the filter ends in an error with every noise tried: replay the case and mend it first"
            )

        def end_where_settled(intermediate_result: OptimizeResult) -> None:
            left, first = (
                max(float(np.log(one.gain_left / SETTLED)), 0.0)
                for one in (expand(intermediate_result.x.tobytes()), begun)
            )
            done = 1.0 - min(left / first, 1.0) if first else 1.0
            progress(1.0 - self.left * (1.0 - 0.5 * done), self.flown)
            if not left:
                raise StopIteration

        result = minimize(
            lambda at: ((here := expand(at.tobytes())).value, here.gradient), begun.at, jac=True,
            hess=lambda at: expand(at.tobytes()).information, method="trust-exact",
            callback=end_where_settled, options=TRUST,
        )  # fmt: skip
        return expand(result.x.tobytes())

    def uncertainty(self, found: Expansion, block_s: float) -> Floats:
        """1 sigma (P,) of the coordinates that were found.

        The information H is that of the criterion. Innovations of one step are independent where the model is right, so
        their gradients have the covariance Σ w² I; those over outages overlap. Where the recording has enough blocks,
        and their gradients scatter more than that, the model is not right and their scatter counts.
        """
        assert found.innovations is not None  # it is the best
        table = found.innovations.table
        overlap = np.where(table["horizon_s"].to_numpy() > 0, OVERLAP, 1.0)
        sums = block_sums(table, found.gradients, block_s)
        scatter = sums - sums.mean(axis=0)
        covariances = [np.einsum("n,npq->pq", overlap * self.weights**2, found.squares)]
        covariances += [scatter.T @ scatter] if len(sums) >= BLOCKS else []
        prior, inverse = PRIOR_SD**-2 * np.eye(len(found.at)), np.linalg.inv(found.information)
        return np.asarray(
            np.max([np.sqrt(np.diag(inverse @ (one + prior) @ inverse)) for one in covariances], axis=0)
        )


def block_sums(table: pl.DataFrame, values: Floats, block_s: float) -> Floats:
    """(b, ...) sums of values (n, ...) over blocks of time; the last, incomplete one belongs to the one before it."""
    since_s = (table["time_ns"].to_numpy() - table["time_ns"].min()) * 1e-9
    sums = np.zeros((max(1, int(since_s.max() // block_s)), *values.shape[1:]))
    np.add.at(sums, np.minimum(since_s // block_s, len(sums) - 1).astype(np.intp), values)
    return sums
