"""Robust fits, and standard deviations that allow for correlated pings."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t

from bottomlock.audit.findings import SIGNIFICANCE
from bottomlock.recordings.robust import correlation_rows, sd_about_median

Array = NDArray[np.float64]

HUBER = 1.345
"""Threshold of Huber's loss in sigmas: 95 % efficiency for Gaussian noise."""

RESAMPLES = 300
BLOCKS = 50
"""Resamples of a bootstrap, and the largest number of blocks of consecutive pings that it draws."""
POLISHED = 8
"""Steps of Gauss and Newton after a nonlinear fit at most."""
LEAST_STRENGTH = 10.0
"""Standard deviations of the slope of a derivative on its instrument, below which a parameter keeps its prior.

It is F = 100, where a t-test of the parameter is right (Lee et al. 2022)."""
PER_BLOCK = 2
"""Correlation times in a block. The variance of the mean of AR(1) noise is then a fraction 1 / (2 × 2) too small at
most, which the thresholds allow for."""
LEAST_BLOCKS = 8
"""Fewer blocks give no standard deviation: with 8 its own relative deviation is 1 / sqrt(2 x 7), a quarter."""


def sigma(values: Array) -> float:
    """Robust standard deviation: the scaled median of the deviations from the median; 0 for fewer than two values.

    >>> sigma(np.array([0.0, 1.0, 2.0, 3.0, 1e9])) < 2.0
    True
    """
    return float(sd_about_median(values)) if values.size > 1 else 0.0


def resolution(values: Array) -> float:
    """Resolution of recorded values: the least non-zero difference; 0 where all are equal.

    >>> resolution(np.array([0.003, 0.001, 0.001, 0.008]))
    0.002
    """
    steps = np.diff(np.unique(np.round(values[np.isfinite(values)], 9)))
    return float(np.round(steps.min(), 9)) if steps.size else 0.0


def sigmas_for(blocks: int) -> float:
    """Standard deviations beyond which a value is significant whose deviation is of this many blocks; else infinite.

    Quantile of Student's t, as a deviation from few blocks is itself uncertain, and larger by what correlation takes
    from the variance of blocks of `PER_BLOCK` times.

    >>> round(sigmas_for(50), 2), sigmas_for(5)
    (5.69, inf)
    """
    if blocks < LEAST_BLOCKS:
        return np.inf
    return float(t.isf(SIGNIFICANCE / 2.0, blocks - 1) / np.sqrt(1.0 - 0.5 / PER_BLOCK))


def blocks_of(rows: int, correlated: float = 1.0) -> NDArray[np.int64]:
    """(rows,) block number of each row: `BLOCKS` blocks of consecutive rows, fewer where they would be too short.

    A block has two rows and `PER_BLOCK` correlation times at least.

    >>> blocks_of(6).tolist(), int(blocks_of(400, 10.0)[-1])
    ([0, 0, 1, 1, 2, 2], 19)
    """
    least = max(2, int(np.ceil(PER_BLOCK * correlated)) if correlated > 1.5 else 2)
    count = max(1, min(BLOCKS, rows // least))
    return np.asarray(np.arange(rows) * count // max(rows, 1), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class LinearFit:
    """Robust fit of `y = X p` with bootstrapped copies.

    Attributes:
        parameters: (p,) or (p, k).
        resampled: (RESAMPLES, p) or (RESAMPLES, p, k) fits of resampled blocks.
        residuals: (n,) or (n, k).
        weights: (n,) Huber weights.
        blocks: number of blocks that were resampled.
    """

    parameters: Array
    resampled: Array
    residuals: Array
    weights: Array
    blocks: int


def huber_weights(residuals: Array) -> Array:
    """(n,) Huber weights of residuals (n, k), by the worst channel of each row, each on its own robust scale."""
    columns = residuals.reshape(len(residuals), -1)
    scale = np.array([max(sigma(column), 1e-12) for column in columns.T])
    worst = (np.abs(columns) / (HUBER * scale)).max(axis=1)
    return np.asarray(1.0 / np.maximum(worst, 1.0))


def fit_linear(X: Array, Y: Array, Z: Array | None = None) -> LinearFit:
    """Huber fit of Y (n, k) on X (n, p), by reweighting; with instruments Z (n, p), two-stage least squares.

    Instruments are needed where the noise of X is correlated with that of Y: Z must share the signal of X and none of
    its noise.

    Source: Huber 1981, section 7.8; block bootstrap of consecutive rows (Künsch 1989), since noise that is correlated
    over several pings would otherwise make the standard deviations too small.
    """
    Z = X if Z is None else Z
    weights = np.ones(len(X))
    for _ in range(30):
        parameters = _solve((Z * weights[:, None]).T @ X, (Z * weights[:, None]).T @ Y)
        update = huber_weights(Y - X @ parameters)
        done = np.max(np.abs(update - weights)) < 1e-6
        weights = update
        if done:
            break
    weighted = Z * weights[:, None]
    Yk = Y.reshape(len(Y), -1)
    scores = weighted[:, :, None] * (Yk - X @ parameters.reshape(X.shape[1], -1))[:, None, :]
    member = blocks_of(len(X), correlation_rows(scores))
    count = int(member[-1]) + 1
    starts = np.searchsorted(member, np.arange(count))
    left = np.add.reduceat(weighted[:, :, None] * X[:, None, :], starts)
    right = np.add.reduceat(weighted[:, :, None] * Yk[:, None, :], starts)
    # A fixed seed: the same log gives the same audit.
    draws = np.random.default_rng(20_240_229).multinomial(count, np.full(count, 1.0 / count), size=RESAMPLES)
    copies = _solve(np.einsum("rb,bij->rij", draws, left), np.einsum("rb,bij->rij", draws, right))
    resampled = copies if Y.ndim == 2 else copies[:, :, 0]
    return LinearFit(parameters, resampled, Y - X @ parameters, weights, count)


def _solve(A: Array, b: Array) -> Array:
    """A⁻¹ b, of least norm where A is singular (readings without closure, for instance); A may be a stack."""
    return np.asarray(np.linalg.pinv(A, rcond=1e-12) @ b)


@dataclass(frozen=True, eq=False)
class NonlinearFit:
    """Robust nonlinear fit: parameters (p,), covariance (p, p), residuals (n, k), weights (n,), sigma, blocks."""

    parameters: Array
    cov: Array
    residuals: Array
    weights: Array
    residual_sigma: float
    blocks: int


def fit_nonlinear(
    residuals_of: Callable[[Array], Array],
    start: Array,
    *,
    scale: Array,
    prior_sd: Array,
    steps: Array | None = None,
    instruments_of: Callable[[Array], Array] | None = None,
) -> NonlinearFit:
    """Huber fit of residuals (n, k) over consecutive instants, with the sandwich covariance over blocks.

    Args:
        residuals_of: parameters (p,) to residuals (n, k).
        start: (p,).
        scale: (p,) typical size of each parameter's change.
        prior_sd: (p,) prior spread about zero, so wide that it matters only for unobservable parameters.
        steps: (p,) of the differences that make the derivatives, by default a ten-thousandth of `scale`. A clock offset
            needs one that is longer than the noise of the recording is correlated: a shorter one takes the derivative
            of that noise for motion.
        instruments_of: parameters (p,) to instrumental variables (n, k, p), which share the motion with the derivatives
            and none of the noise in them; by default derivatives with twice the step. A parameter whose derivative
            hardly follows its own keeps its prior.

    Source: scipy's trust-region least squares with Huber's loss; covariance A⁻¹ B A⁻¹ with the scores of a block
    summed before they are squared (White 1980; Liang and Zeger 1986).
    """
    steps = 1e-4 * scale if steps is None else steps
    instruments_of = instruments_of or (lambda p: jacobian(residuals_of, p, 2.0 * steps))
    strong = are_strong(residuals_of, instruments_of, start, steps)
    parameters, spread = np.where(strong, start, 0.0), 0.0
    for _ in range(4):
        before = spread
        spread = max(sigma(residuals_of(parameters).ravel()), 1e-9)
        if before and abs(spread - before) < 1e-3 * before:
            break

        def whitened(p: Array, spread: float = spread) -> Array:
            return np.concatenate([residuals_of(p).ravel() / spread, p / prior_sd])

        def slopes(p: Array, spread: float = spread) -> Array:
            J = jacobian(residuals_of, p, steps) * strong
            return np.concatenate([J.reshape(-1, len(p)) / spread, np.diag(1.0 / prior_sd)])

        solved = least_squares(
            whitened, parameters, jac=slopes, x_scale=scale, loss="huber", f_scale=HUBER, method="trf"
        )
        parameters = np.asarray(solved.x)
    for _ in range(POLISHED):
        final = residuals_of(parameters)
        J, Z = jacobian(residuals_of, parameters, steps), instruments_of(parameters)
        W = (huber_weights(final) / spread**2)[:, None, None]
        strong &= _strength(J, Z) > LEAST_STRENGTH
        J, Z = J * strong, Z * strong
        A = np.einsum("nki,nkj->ij", W * Z, J) + np.diag(1.0 / prior_sd**2)
        change = np.linalg.solve(A, np.einsum("nki,nk->i", W * Z, final) + parameters / prior_sd**2)
        if np.all(np.abs(change) < 1e-4 * np.sqrt(np.abs(np.diag(np.linalg.inv(A))))):
            break
        parameters = parameters - change
    final = residuals_of(parameters)
    scores = np.einsum("nki,nk->ni", W * Z, final)
    member = blocks_of(len(final), correlation_rows(scores))
    sums = np.add.reduceat(scores, np.searchsorted(member, np.arange(member[-1] + 1)))
    # As many sums are zero as there are parameters. The prior adds its own information, so that an unobservable
    # parameter keeps the prior's spread.
    spare = len(sums) / max(len(sums) - len(parameters), 1)
    B = spare * sums.T @ sums + np.diag(1.0 / prior_sd**2)
    inverse = np.linalg.inv(A)
    return NonlinearFit(
        parameters, inverse @ B @ inverse.T, final, W[:, 0, 0] * spread**2, spread, int(member[-1]) + 1
    )


def are_strong(
    residuals_of: Callable[[Array], Array], instruments_of: Callable[[Array], Array], at: Array, steps: Array
) -> NDArray[np.bool_]:
    """(p,) whether the derivatives at parameters (p,) follow their instrumental variables closely enough."""
    return _strength(jacobian(residuals_of, at, steps), instruments_of(at)) > LEAST_STRENGTH


def _strength(J: Array, Z: Array) -> Array:
    """(p,) slopes of derivatives on their instrumental variables, in standard deviations; infinite where they agree."""
    ZJ, ZZ = np.einsum("nki,nki->i", Z, J), np.einsum("nki,nki->i", Z, Z)
    slope = np.divide(ZJ, ZZ, out=np.zeros_like(ZJ), where=ZZ > 0.0)
    scores = np.einsum("nki,nki->ni", Z, J - slope * Z)
    member = blocks_of(len(J))
    sums = np.add.reduceat(scores, np.searchsorted(member, np.arange(member[-1] + 1)))
    sd = np.sqrt(np.sum(sums**2, axis=0))
    return np.asarray(np.divide(ZJ, sd, out=np.full_like(ZJ, np.inf), where=sd > 1e-9 * np.abs(ZJ)))


def jacobian(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """(n, k, p) central differences of residuals (n, k) in parameters (p,)."""
    columns = []
    for index, size in enumerate(steps):
        step = np.zeros_like(at)
        step[index] = size
        columns.append((function(at + step) - function(at - step)) / (2.0 * size))
    return np.stack(columns, axis=-1)
