"""Assessment of the beams of a log: matrix, order and signs, and single beams off their direction."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.audit.beam_findings import (
    bias_findings,
    closure_findings,
    combination_findings,
    match_findings,
    order_findings,
    parallel_beams,
    scale_findings,
    self_findings,
    slope_findings,
    tilt_findings,
    unobservable_findings,
)
from bottomlock.audit.beam_order import Match, match
from bottomlock.audit.closure import Closure, Slope, closure_of, closure_slope, null_space, null_space_cov
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, READINGS_TO_VELOCITY, Matrix, find_matrix
from bottomlock.audit.robust import Array
from bottomlock.recordings.finding import Finding


@dataclass(frozen=True, eq=False)
class BeamAssessment:
    """Assessment of the beams of a log.

    Attributes:
        full: (n,) pings used: every beam valid, not stale, no zero of a beam that reads zero when lost.
        matrix: the beam matrix by regression against the instrument's velocity, or None.
        match: its match with the stated geometry, or None.
        rows: (beams, 3) geometry used for the closure, in the order and with the signs of the log; or None.
        closures: statistics, one for each combination in the null space; empty for three beams.
        slope: of the first closure on the velocity, or None.
        ambiguous: another order explains the closure as simply as that of `rows`.
        findings: unranked.
    """

    full: NDArray[np.bool_]
    matrix: Matrix | None = None
    match: Match | None = None
    rows: Array | None = None
    closures: list[Closure] = field(default_factory=list)
    slope: Slope | None = None
    ambiguous: bool = False
    findings: list[Finding] = field(default_factory=list)


def assess_beams(
    log: BeamLog, full: NDArray[np.bool_], stated: Array | None, copies: list[tuple[int, ...]]
) -> BeamAssessment:
    """Assesses the beams of a log: directions, order, signs, tilt, scale, bias and closure.

    Args:
        log: the pings.
        full: (n,) pings to use.
        stated: (beams, 3) stated directions in the frame of the instrument's velocity, or None.
        copies: pairs of channels (numbers from 1) found before to hold the same numbers.
    """
    found = _against_velocity(log, full, stated, copies)
    identical = bool(copies) or any(one.kind == "identical_beams" for one in found.findings)
    if full.sum() < LEAST_PINGS or identical:
        return found
    readings = log.velocity_mps[full]
    if found.rows is None:
        notes, closures = combination_findings(readings)
        return replace(found, closures=closures, findings=found.findings + notes)
    if log.beams >= 4:
        regressed = found.matrix is not None and found.rows is found.matrix.rows
        notes, rows, ambiguous = order_findings(readings, found.rows, regressed=regressed)
        found = replace(found, rows=rows, ambiguous=ambiguous, findings=found.findings + notes)
    return _with_closures(found, readings)


def _against_velocity(
    log: BeamLog, full: NDArray[np.bool_], stated: Array | None, copies: list[tuple[int, ...]]
) -> BeamAssessment:
    """The beam matrix against the instrument's velocity, and its match with the stated geometry."""
    matrix: Matrix | None = None
    solved = full & log.solved
    if log.instrument_mps is not None and log.own_frame and log.beams >= 3:
        matrix = find_matrix(log.velocity_mps[solved], log.instrument_mps[solved])
    if matrix is None or not matrix.observable.all():
        rows = None if stated is None else np.array(stated)
        findings = unobservable_findings(log, matrix, int(solved.sum()))
        return BeamAssessment(full, matrix, rows=rows, findings=findings)
    if stated is None:
        findings = self_findings(matrix, copies) + scale_findings(matrix)
        return BeamAssessment(full, matrix, rows=matrix.rows, findings=findings)
    matched = match(matrix.directions, stated)
    findings = match_findings(matrix, matched, copies)
    findings += tilt_findings(matrix, matched, stated, parallel_beams(findings, copies))
    findings += scale_findings(matrix, np.linalg.norm(stated[matched.beam], axis=1))
    return BeamAssessment(full, matrix, matched, matrix.rows, findings=findings)


def _with_closures(found: BeamAssessment, readings: Array) -> BeamAssessment:
    """Closure statistics, the slope of the first closure on the velocity, and biases, with their findings."""
    rows, matrix = found.rows, found.matrix
    assert rows is not None
    exact = matrix is not None and matrix.regression == READINGS_TO_VELOCITY
    against = matrix is not None and bool(matrix.observable.all())
    weights = null_space(rows)
    closures = [closure_of(column, readings) for column in weights.T]
    if matrix is not None and rows is matrix.rows:
        middle = np.linalg.pinv(rows) @ np.median(readings, axis=0)
        closures = [
            one.with_rows_uncertain(middle, null_space_cov(rows, matrix.resampled, one.weights))
            for one in closures
        ]
    slope: Slope | None = None
    biases = bias_findings(matrix, closures) if matrix is not None and against else []
    # A bias that the instrument's velocity shows leaves no doubt of the order.
    findings = [one for one in found.findings if not (biases and one.kind == "order_or_bias")]
    doubtful = any(one.kind == "order_or_bias" for one in findings)
    dependence: list[Finding] = []
    # Rows from a regression on the velocity leave no part of the closure that follows it.
    if closures and not doubtful and not (matrix is not None and rows is matrix.rows and not exact):
        velocity = readings @ np.linalg.pinv(rows).T
        slope = closure_slope(closures[0].values_mps, velocity, np.flatnonzero(found.full))
        if slope is not None and matrix is not None and rows is matrix.rows:
            slope = slope.with_rows_uncertain(null_space_cov(rows, matrix.resampled, weights[:, 0]))
        if slope is not None:
            dependence = slope_findings(slope, velocity)
    findings += dependence + biases
    for closure in closures:
        # The median of a closure that depends on the velocity is no bias, and a named bias is named once.
        findings += closure_findings(closure, unbiased=bool(dependence or biases) or doubtful)
    return replace(found, closures=closures, slope=slope, findings=findings)
