"""A candidate judged where it was not estimated: scores, errors over claimed σ, whiteness, beams left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bottomlock.recordings.streams import Floats
from bottomlock.replay.tune.criterion import WORST, Candidate, Criterion
from bottomlock.replay.tune.likelihood import white_residuals
from bottomlock.replay.tune.passes import LEFT_OUT, LOST_S, Group

SUM_S = 30.0
"""Span of the sums of innovations that are tested for whiteness."""


@dataclass(frozen=True)
class Term:
    """A sensor and a horizon: innovations, rows, mean score a row, and error over claimed σ."""

    sensor: str
    horizon_s: float
    count: int
    score: float
    error_over_sd: float


@dataclass(frozen=True)
class Judged:
    """What the held-out part says of a candidate.

    Attributes:
        terms: by sensor and horizon.
        autocorrelation: of neighbouring whitened innovations of the beams; 0 if they are white.
        sums: mean square of their normalised sums over `SUM_S`; 1 if they are white.
        left_out: error over claimed σ of a beam that was left out for up to a minute; NaN without a beam to spare.
    """

    terms: tuple[Term, ...]
    autocorrelation: float
    sums: float
    left_out: float


def judged(candidate: Candidate, horizons_s: Sequence[float]) -> Judged | None:
    """The judgement of a candidate; None where its filter ended in an error."""
    scored = candidate.scores
    if scored is None:
        return None
    terms = []
    for (sensor, horizon), of in scored.terms.items():
        rows = int(scored.rows[of].sum())
        terms.append(
            Term(
                sensor,
                LOST_S if sensor == LEFT_OUT else (0.0, *horizons_s)[horizon],
                int(of.sum()),
                float(scored.value[of].sum() / rows),
                float(np.sqrt(scored.nis[of].sum() / rows)),
            )
        )
    steps = [group for group in candidate.groups if group.sensor == "beams" and not group.horizon.any()]
    most = max(steps, key=lambda group: len(group.time_ns), default=None)
    autocorrelation, sums = (np.nan, np.nan) if most is None else _whiteness(most)
    left_out = [term.error_over_sd for term in terms if term.sensor == LEFT_OUT]
    return Judged(tuple(terms), autocorrelation, sums, left_out[0] if left_out else np.nan)


def _whiteness(group: Group) -> tuple[float, float]:
    """Correlation of neighbours, and the mean square of normalised sums over a span of time."""
    white = white_residuals(group)
    if len(white) < 3:
        return np.nan, np.nan
    neighbours = float((white[1:] * white[:-1]).mean() / (white**2).mean())
    block = ((group.time_ns - group.time_ns[0]) * 1e-9 // SUM_S).astype(np.intp)
    counts = np.bincount(block)
    sums = np.stack([np.bincount(block, column) for column in white.T], axis=1)
    full = counts >= max(2, int(0.5 * np.median(counts)))
    return neighbours, float((sums[full] ** 2 / counts[full, None]).mean())


def gain_of(criterion: Criterion, old: Candidate, new: Candidate, block_s: float) -> tuple[float, float]:
    """Gain of the composite log-likelihood and its 1 sigma, from blocks of the recording.

    A filter that ended in an error has lost.
    """
    if old.scores is None or new.scores is None:
        return (WORST if old.scores is None else -WORST), 0.0
    gain: Floats = criterion.weights * (old.scores.value - new.scores.value)
    block = ((new.scores.time_ns - new.scores.time_ns.min()) * 1e-9 // block_s).astype(np.intp)
    sums = np.bincount(block, gain)
    sd = float(np.sqrt(len(sums)) * sums.std(ddof=1)) if len(sums) > 1 else float("nan")
    return float(gain.sum()), sd
