"""Odds of causes of a closure that is not zero: a bias, or beams in another order or with another sign.

A combination of readings that no velocity moves holds noise alone. Of noise that is equal in all beams, the density of
a ping's readings over all velocities depends on the order only through the density of that order's closure (unit
weights), so the densities of two closures are the likelihoods of their orders. The noise is taken as of Student's t
with a correlation from ping to ping, its numbers fitted to each closure, so that neither heavy tails nor a slow wander
decide; one number more is the bias. Two hypotheses are compared by BIC (Schwarz 1978).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from bottomlock.audit.beam_order import Order
from bottomlock.audit.closure import null_space
from bottomlock.audit.robust import Array, resolution, sigma

BETTER = 0.5
"""An order is considered whose closure is smaller than this of the stated one's."""

_TAILS = (2.5, 4.0, 8.0, 200.0)
"""Degrees of freedom of Student's t that are tried: from heavy tails to Gaussian."""


@dataclass(frozen=True)
class Hypothesis:
    """An order with or without a bias: the bias of its unit combination, m/s, and its share of the probability.

    `log_share` is the logarithm of `share`, which may be too small for a number.
    """

    order: Order
    biased: bool
    bias_mps: float
    log_share: float

    @property
    def share(self) -> float:
        """Probability among the hypotheses, equal before the log."""
        return float(np.exp(self.log_share))


def order_odds(readings_mps: Array, stated: Array, orders: list[Order]) -> list[Hypothesis]:
    """The orders, each with and without a bias, the most probable first.

    Args:
        readings_mps: (n, beams) of full pings.
        stated: (beams, 3).
        orders: from `orders_by_closure`; the first, simplest, of those with the same closure stands for all.
            Orders that do not close far better than the stated one are not considered.
    """
    plain = next(one for one in orders if one.steps == 0)
    if min(one.closure_mps for one in orders) > BETTER * plain.closure_mps:
        return []
    floor = max(resolution(column) for column in readings_mps.T) / np.sqrt(12.0)
    made: list[tuple[Order, bool, float, float]] = []
    seen: list[float] = []
    for order in orders:
        if any(abs(order.closure_mps - other) < 1e-12 for other in seen):
            continue
        seen.append(order.closure_mps)
        weights = null_space(np.array(order.sign)[:, None] * stated[list(order.beam)])
        if weights.shape[1] != 1:
            return []
        if order.steps and order.closure_mps > BETTER * plain.closure_mps:
            continue
        values = readings_mps @ (weights[:, 0] / np.linalg.norm(weights[:, 0]))
        for biased in (False, True):
            fit, bias = log_likelihood(values, biased=biased, floor=floor)
            made.append((order, biased, bias, fit - 0.5 * (3 + biased) * np.log(len(values))))
    scores = np.array([one[3] for one in made])
    logs = scores - np.logaddexp.reduce(scores)
    told = [Hypothesis(o, b, bias, float(s)) for (o, b, bias, _), s in zip(made, logs, strict=True)]
    return sorted(told, key=lambda one: -one.log_share)


def log_likelihood(values: Array, *, biased: bool, floor: float) -> tuple[float, float]:
    """Largest log likelihood of AR(1) noise of Student's t, and the bias, m/s; by expectation-maximisation."""
    now, before = values[1:], values[:-1]
    columns = [before, np.ones_like(before)] if biased else [before]
    X = np.stack(columns, axis=1)
    best, bias = -np.inf, 0.0
    for tail in _TAILS:
        weights, scale = np.ones(len(now)), max(sigma(values), floor, 1e-9)
        for _ in range(40):
            p = np.linalg.lstsq(X * np.sqrt(weights)[:, None], now * np.sqrt(weights), rcond=None)[0]
            # A correlation of one or more is a random walk, which any motion is.
            p[0] = np.clip(p[0], -0.95, 0.95)
            if biased:
                p[1] = np.average(now - p[0] * before, weights=weights)
            off = now - X @ p
            scale = max(float(np.sqrt(np.mean(weights * off**2))), floor, 1e-9)
            update = (tail + 1.0) / (tail + (off / scale) ** 2)
            done = float(np.max(np.abs(update - weights))) < 1e-3
            weights = update
            if done:
                break
        found = len(now) * (
            gammaln(0.5 * (tail + 1.0)) - gammaln(0.5 * tail) - 0.5 * np.log(tail * np.pi) - np.log(scale)
        ) - 0.5 * (tail + 1.0) * float(np.sum(np.log1p((off / scale) ** 2 / tail)))
        if found > best:
            best, bias = float(found), float(p[1] / (1.0 - p[0])) if biased else 0.0
    return best, bias
