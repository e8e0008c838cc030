"""Odds of causes of a closure that is not zero: a bias, or beams in another order or with another sign.

A combination of readings that no velocity moves holds noise alone. Of noise that is equal in all beams, the density of
a ping's readings over all velocities depends on the order only through the density of that order's closure (unit
weights), so the densities of two closures are the likelihoods of their orders. The noise is taken as of Student's t
with a correlation from ping to ping, its numbers fitted to each closure, so that neither heavy tails nor a slow wander
decide; one number more is the bias.

The two closures hold different noise, so that their log likelihoods differ by chance, by about the root of the number
of pings, even where the vehicle keeps one velocity and nothing can be told. The difference is therefore divided by its
own standard deviation over pings, and is then a standard normal variable where both describe the log equally well
(Vuong 1989, with BIC's allowance for the bias).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln
from scipy.stats import norm

from bottomlock.audit.beam_order import Order
from bottomlock.audit.closure import null_space
from bottomlock.audit.robust import Array, resolution, sigma
from bottomlock.statistics.correlation import correlation_rows

BETTER = 0.5
"""An order is considered whose closure is smaller than this of the stated one's."""

_TAILS = (2.5, 4.0, 8.0, 200.0)
"""Degrees of freedom of Student's t that are tried: from heavy tails to Gaussian."""


@dataclass(frozen=True)
class Odds:
    """The stated order with a bias (m/s, of the closure with weights up to 1) against the order that closes best.

    `log_stated` is the logarithm of the probability that the stated order describes the log better; it may be too small
    for a number.
    """

    bias_mps: float
    log_stated: float


def order_odds(readings_mps: Array, stated: Array, orders: list[Order]) -> Odds | None:
    """The odds; None where no order closes far better than the stated one, or where there is no single closure.

    Args:
        readings_mps: (n, beams) of full pings.
        stated: (beams, 3).
        orders: from `orders_by_closure`, the best first.
    """
    plain, best = next(one for one in orders if one.steps == 0), orders[0]
    if best.closure_mps > BETTER * plain.closure_mps:
        return None
    weights = [null_space(np.array(one.sign)[:, None] * stated[list(one.beam)]) for one in (plain, best)]
    if any(one.shape[1] != 1 for one in weights):
        return None
    length = float(np.linalg.norm(weights[0]))
    values = [readings_mps @ (one[:, 0] / np.linalg.norm(one[:, 0])) for one in weights]
    floor = max(resolution(column) for column in readings_mps.T) / np.sqrt(12.0)
    stays, bias = log_likelihoods(values[0], biased=True, floor=floor)
    moves, _ = log_likelihoods(values[1], biased=False, floor=floor)
    return Odds(bias * length, float(norm.logsf(advantage(moves, stays, fewer=1))))


def advantage(one: Array, other: Array, *, fewer: int = 0) -> float:
    """By how many standard deviations log likelihoods (n,) exceed others that have `fewer` numbers more."""
    gain = one - other
    worth = max(len(gain) / correlation_rows(gain), 2.0)
    total = float(gain.mean()) + 0.5 * fewer * np.log(len(gain)) / len(gain)
    return float(total * np.sqrt(worth) / max(float(gain.std()), 1e-12))


def log_likelihoods(values: Array, *, biased: bool, floor: float) -> tuple[Array, float]:
    """Log likelihoods (n − 1,) of AR(1) noise of Student's t, and the bias, m/s; by expectation-maximisation."""
    now, before = values[1:], values[:-1]
    columns = [before, np.ones_like(before)] if biased else [before]
    X = np.stack(columns, axis=1)
    best, bias = np.full(len(now), -np.inf), 0.0
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
        found = (
            gammaln(0.5 * (tail + 1.0)) - gammaln(0.5 * tail) - 0.5 * np.log(tail * np.pi) - np.log(scale)
            - 0.5 * (tail + 1.0) * np.log1p((off / scale) ** 2 / tail)
        )  # fmt: skip
        if found.sum() > best.sum():
            best, bias = np.asarray(found), float(p[1] / (1.0 - p[0])) if biased else 0.0
    return best, bias
