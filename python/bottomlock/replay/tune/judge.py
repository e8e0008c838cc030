"""A candidate judged where it was not estimated: scores, errors over claimed σ, whiteness, beams left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.replay.tune.criterion import TERM, WORST, Candidate, Criterion, block_sums, white_residuals
from bottomlock.replay.tune.passes import LEFT_OUT, LOST_S, Group

SUM_S = 30.0
"""Span of the sums of innovations that are tested for whiteness."""


@dataclass(frozen=True)
class Term:
    """A sensor and a horizon: innovations, mean score a row, and error over claimed σ."""

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
    if candidate.scores is None:
        return None
    per_row = {name: pl.col(name).sum() / pl.col("rows").sum() for name in ("value", "nis")}
    table = candidate.scores.group_by(TERM).agg(pl.len(), per_row["value"], per_row["nis"].sqrt()).sort(TERM)
    terms = [
        Term(sensor, LOST_S if sensor == LEFT_OUT else (0.0, *horizons_s)[horizon], *numbers)
        for sensor, horizon, *numbers in table.iter_rows()
    ]
    steps = [group for group in candidate.groups if group.sensor == "beams" and not group.horizon.any()]
    whiteness = _whiteness(max(steps, key=lambda group: len(group.time_ns))) if steps else (np.nan, np.nan)
    left_out = next((term.error_over_sd for term in terms if term.sensor == LEFT_OUT), np.nan)
    return Judged(tuple(terms), *whiteness, left_out)


def _whiteness(group: Group) -> tuple[float, float]:
    """Correlation of neighbours, and the mean square of normalised sums over a span of time."""
    white = white_residuals(group)
    if len(white) < 3:
        return np.nan, np.nan
    neighbours = float((white[1:] * white[:-1]).mean() / (white**2).mean())
    block = ((group.time_ns - group.time_ns[0]) * 1e-9 // SUM_S).astype(np.intp)
    counts = np.bincount(block)
    sums = np.zeros((len(counts), white.shape[1]))
    np.add.at(sums, block, white)
    full = counts >= max(2, int(0.5 * np.median(counts)))
    return neighbours, float((sums[full] ** 2 / counts[full, None]).mean())


def gain_of(criterion: Criterion, old: Candidate, new: Candidate, block_s: float) -> tuple[float, float]:
    """Gain of the composite log-likelihood and its 1 sigma, from blocks of the recording.

    A filter that ended in an error has lost.
    """
    if old.scores is None or new.scores is None:
        return (WORST if old.scores is None else -WORST), 0.0
    gain = criterion.weights * (old.scores["value"] - new.scores["value"]).to_numpy()
    sums = block_sums(new.scores, gain, block_s)
    sd = float(np.sqrt(len(sums)) * sums.std(ddof=1)) if len(sums) > 1 else float("nan")
    return float(gain.sum()), sd
