"""Standard deviations of tuned parameters: the sandwich of a composite likelihood (Godambe), with the priors."""

import numpy as np

from bottomlock.recordings.streams import Floats, Times
from bottomlock.replay.tune.criterion import Criterion
from bottomlock.replay.tune.parameters import PRIOR_SD
from bottomlock.replay.tune.search import Found

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
