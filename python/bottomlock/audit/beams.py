"""Assessment of the beams of a log: matrix, order and signs, closures, and single beams off their direction."""

import itertools
from dataclasses import dataclass, field, replace

import numpy as np

from bottomlock.audit.beam_order import NEAR_RAD, Match, match
from bottomlock.audit.closure import (
    Closure,
    Slope,
    closure_of,
    closure_slope,
    null_space,
    null_space_cov,
)
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_RAD
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, READINGS_TO_VELOCITY, Matrix, line_angle
from bottomlock.audit.robust import Array, Flags, significant
from bottomlock.recordings.closure import Reordered, find_order

BETTER, FAR_BETTER = 0.5, 0.2
"""An order is considered whose closure is smaller than this of the stated one's; of a matrix by regression, than this.

A fault of one channel in the record alone shows in every row of such a matrix, and another order may halve its closure.
"""

TURNED_RAD = 1e-9
"""A smaller common rotation is none."""
Pairs = tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class BeamAssessment:
    """Assessment of the beams of a log.

    Attributes:
        full: (n,) pings used: every beam valid, not stale, no zero of a beam that reads zero when lost.
        matrix: the beam matrix by regression against the instrument's velocity, or None.
        seen: it is observable.
        match: its match with the stated geometry, or None.
        copies: pairs of channels that hold the same numbers.
        parallel: pairs of its channels with different numbers but parallel (or antiparallel) directions.
        stated: (beams, 3) stated directions times scale in the frame of the instrument's velocity, or None.
        rows: (beams, 3) geometry used for the closure, in the order and with the signs of the log; or None.
        closures: statistics, one for each combination in the null space; empty for three beams.
        slope: of the first closure on the velocity, or None.
        reordered: orders other than stated, or None.
        bias_mps, bias_sd_mps: (beams,) against the instrument's velocity; empty where none shows.
    """

    full: Flags
    matrix: Matrix | None = None
    seen: bool = False
    match: Match | None = None
    copies: Pairs = ()
    parallel: Pairs = ()
    stated: Array | None = None
    rows: Array | None = None
    closures: list[Closure] = field(default_factory=list)
    slope: Slope | None = None
    reordered: Reordered | None = None
    bias_mps: Array = field(default_factory=lambda: np.zeros(0))
    bias_sd_mps: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def ambiguous(self) -> bool:
        """Another order explains the closure as simply as that of `rows`."""
        return self.reordered is not None and (self.reordered.or_bias or len(self.reordered.orders) > 1)

    @property
    def biased(self) -> list[int]:
        """Beams with a bias against the instrument's velocity."""
        if self.matrix is None:
            return []
        sure = significant(self.bias_mps, self.bias_sd_mps, self.matrix.blocks, MATERIAL_MPS)
        return [int(k) for k in np.flatnonzero(sure)]

    @property
    def doubtful(self) -> bool:
        """The order may be wrong, or a beam biased; a bias that the instrument's velocity shows leaves no doubt."""
        return self.reordered is not None and self.reordered.or_bias and not self.biased

    @property
    def explained(self) -> bool:
        """The median of the closures is no further finding: a named bias is named once, and a slope gives a median."""
        return bool(self.biased) or self.doubtful or (self.slope is not None and self.slope.material)

    def _single(self, beams: Flags) -> list[int]:
        """Those of the beams that are not read twice."""
        twice = {beam for pair in (*self.parallel, *self.copies) for beam in pair}
        return [int(k) for k in np.flatnonzero(beams) if int(k) not in twice]

    @property
    def moved(self) -> list[int]:
        """Channels that are another beam than stated."""
        return [] if self.match is None else self._single(self.match.beam != np.arange(len(self.match.beam)))

    @property
    def flipped(self) -> list[int]:
        """Channels of the opposite sign of the stated beam."""
        return [] if self.match is None else self._single(self.match.sign < 0)

    @property
    def off(self) -> list[int]:
        """Channels off their stated direction."""
        m, found = self.matrix, self.match
        if m is None or found is None:
            return []
        return self._single(significant(found.off_rad, m.direction_sd_rad, m.blocks, MATERIAL_RAD))

    @property
    def turned_rad(self) -> float:
        """Size of the common rotation from the stated geometry."""
        return 0.0 if self.match is None else float(self.match.rotation.magnitude())

    @property
    def fits(self) -> bool:
        """Nothing shows that the beams are not the stated ones."""
        depends = self.slope is not None and self.slope.material
        ordered = self.reordered is None or (self.reordered.or_bias and not self.doubtful)
        same = self.turned_rad < TURNED_RAD and not (self.moved or self.flipped or self.off or self.parallel)
        return same and ordered and not depends


def assess_beams(
    log: BeamLog, full: Flags, matrix: Matrix | None, stated: Array | None, copies: Pairs = ()
) -> BeamAssessment:
    """Assesses the beams of a log: directions, order, signs, tilt, scale, bias and closure.

    Args:
        log: the pings.
        full: (n,) pings to use.
        matrix: by regression of these against the instrument's velocity, or None.
        stated: (beams, 3) stated directions in the frame of the instrument's velocity, or None.
        copies: pairs of channels found before to hold the same numbers.
    """
    found = BeamAssessment(full, matrix, stated=stated, rows=stated, copies=copies)
    if matrix is not None and matrix.observable.all():
        u, pairs = matrix.directions, itertools.combinations(range(log.beams), 2)
        found = replace(
            found, seen=True, rows=matrix.rows, match=None if stated is None else match(u, stated),
            parallel=tuple(
                (i, j) for i, j in pairs if (i, j) not in copies and line_angle(u[i], u[j]) < NEAR_RAD
            ),
        )  # fmt: skip
    readings, rows = log.velocity_mps[full], found.rows
    if rows is None or len(readings) < LEAST_PINGS or copies or found.parallel:
        return found
    reordered = None
    if log.beams >= 4:
        better = FAR_BETTER if found.seen else BETTER
        reordered = find_order(readings, rows, better=better, least_mps=MATERIAL_MPS)
    if reordered is not None and not reordered.or_bias:
        one = reordered.orders[0]
        rows = np.array(one.sign)[:, None] * rows[list(one.beam)]
    return _with_closures(replace(found, rows=rows, reordered=reordered), readings)


def rematched(found: BeamAssessment, stated: Array) -> BeamAssessment:
    """The same beams, whose matrix was observed, beside another stated geometry: all but the match stays."""
    assert found.matrix is not None
    return replace(found, stated=stated, match=match(found.matrix.directions, stated))


def _biases(matrix: Matrix, closures: list[Closure]) -> tuple[Array, Array]:
    """Biases of the beams (beams,) against the instrument's own velocity and their 1 sigma; empty where none shows.

    The regression observes the biases that act like a velocity, the closure the rest. A bias that the instrument has
    included in its velocity is observed by the closure alone.
    """
    if not significant(matrix.bias_mps, matrix.bias_sd_mps, matrix.blocks, MATERIAL_MPS).any():
        return np.zeros(0), np.zeros(0)
    bias, variance = matrix.bias_mps.copy(), matrix.bias_sd_mps**2
    # A regression of the readings holds the whole bias; one of the velocity lacks the part in the closure.
    for one in closures if matrix.regression == READINGS_TO_VELOCITY else []:
        share = one.weights / float(one.weights @ one.weights)
        bias += share * one.median_mps
        variance = variance + (share * one.median_sd_mps) ** 2
    return bias, np.sqrt(variance)


def _with_closures(found: BeamAssessment, readings: Array) -> BeamAssessment:
    """Closure statistics, biases, and the slope of the first closure on the velocity."""
    rows, matrix = found.rows, found.matrix
    assert rows is not None
    weights = null_space(rows).T
    regressed = matrix is not None and rows is matrix.rows
    covs = [null_space_cov(rows, matrix.resampled, one) for one in weights] if matrix and regressed else []
    middle = np.linalg.pinv(rows) @ np.median(readings, axis=0)
    added = [float(np.sqrt(middle @ cov @ middle)) for cov in covs] or [0.0] * len(weights)
    closures = [closure_of(*one) for one in zip(weights, [readings] * len(weights), added, strict=True)]
    bias, sd = _biases(matrix, closures) if matrix is not None and found.seen else (np.zeros(0), np.zeros(0))
    found = replace(found, closures=closures, bias_mps=bias, bias_sd_mps=sd)
    # Rows from a regression on the velocity leave no part of the closure that follows it.
    follows = not regressed or (matrix is not None and matrix.regression == READINGS_TO_VELOCITY)
    if not closures or found.doubtful or not follows:
        return found
    velocity = readings @ np.linalg.pinv(rows).T
    values, pings = closures[0].values_mps, np.flatnonzero(found.full)
    return replace(found, slope=closure_slope(values, velocity, pings, covs[0] if covs else 0.0))
