"""Judgement on the beams of a log: which matrix, which order, which beam is off its place."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bottomlock.audit.beam_order import Match, Order, match, orders_by_closure
from bottomlock.audit.closure import (
    Closure,
    Slope,
    Suspect,
    closure_of,
    closure_slope,
    null_space,
    null_space_cov,
    suspects,
)
from bottomlock.audit.closure_findings import (
    closure_findings,
    combination_findings,
    order_findings,
    slope_findings,
)
from bottomlock.audit.findings import SIGNIFICANCE, Finding
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, Matrix, find_matrix
from bottomlock.audit.matrix_findings import (
    bias_findings,
    match_findings,
    scale_findings,
    self_findings,
    unobservable_findings,
)
from bottomlock.audit.robust import Array


@dataclass(frozen=True, eq=False)
class BeamVerdict:
    """What the beams of a log say.

    Attributes:
        full: (n,) pings that were used: every beam valid, not stale, no zero of a beam that reads zero for lost.
        matrix: the beams as the instrument's velocity sees them, or None.
        match: of the matrix with the stated geometry, or None.
        rows: (beams, 3) geometry that the rest was judged with, in the order and with the signs of the log; or None.
        closures: statistics, one for each combination that no velocity moves; empty for three beams.
        slope: of the first closure on the velocity, or None.
        suspects: single beams that would explain the slope; empty where it is not significant.
        orders: orders by closure, the best first; empty where they were not tried.
        ambiguous: another order explains the closure as simply as the one that `rows` is in.
        findings: in no order.
    """

    full: NDArray[np.bool_]
    matrix: Matrix | None = None
    match: Match | None = None
    rows: Array | None = None
    closures: list[Closure] = field(default_factory=list)
    slope: Slope | None = None
    suspects: list[Suspect] = field(default_factory=list)
    orders: list[Order] = field(default_factory=list)
    ambiguous: bool = False
    findings: list[Finding] = field(default_factory=list)


def judge_beams(
    log: BeamLog, full: NDArray[np.bool_], stated: Array | None, copies: list[tuple[int, ...]]
) -> BeamVerdict:
    """Directions, order, signs, tilt, scale, bias and closure of the beams of a log.

    Args:
        log: the pings.
        full: (n,) pings to use.
        stated: (beams, 3) stated directions in the frame of the instrument's velocity, or None.
        copies: pairs of channels (numbers from 1) already known to be the same numbers.
    """
    findings: list[Finding] = []
    matrix: Matrix | None = None
    matched: Match | None = None
    rows: Array | None
    solved = full & log.solved
    if log.instrument_mps is not None and log.own_frame and log.beams >= 3:
        matrix = find_matrix(log.velocity_mps[solved], log.instrument_mps[solved])
    if matrix is not None and matrix.observable.all():
        if stated is not None:
            matched = match(matrix.directions, stated)
            findings += match_findings(matrix, matched, stated, copies)
        else:
            findings += self_findings(matrix, copies)
        findings += scale_findings(matrix)
        rows = matrix.rows
    else:
        findings += unobservable_findings(log, matrix, int(solved.sum()))
        rows = None if stated is None else np.array(stated)
    orders: list[Order] = []
    ambiguous = False
    same_way = bool(copies) or any(one.kind == "identical_beams" for one in findings)
    if full.sum() < LEAST_PINGS or same_way:
        return BeamVerdict(full, matrix, matched, rows, findings=findings)
    readings = log.velocity_mps[full]
    if rows is None:
        found, closures = combination_findings(readings)
        return BeamVerdict(full, matrix, closures=closures, findings=findings + found)
    if log.beams >= 4:
        orders = orders_by_closure(readings, rows)
        found, rows, ambiguous = order_findings(orders, rows)
        findings += found
    weights = null_space(rows)
    closures = [closure_of(column, readings) for column in weights.T]
    slope, blamed, moves = None, [], []
    if closures:
        velocity = readings @ np.linalg.pinv(rows).T
        slope = closure_slope(closures[0].values_mps, velocity, np.flatnonzero(full))
        if slope is not None and matrix is not None and rows is matrix.rows:
            unsure = null_space_cov(rows, matrix.resampled, weights[:, 0])
            slope = replace(slope, cov=slope.cov + unsure)
        if slope is not None and slope.p_value < SIGNIFICANCE:
            blamed = suspects(slope, weights[:, 0], rows)
            moves = slope_findings(slope, blamed, rows, velocity)
    biases = [] if matrix is None or rows is not matrix.rows else bias_findings(matrix, closures)
    findings += moves + biases
    for closure in closures:
        # A closure that moves with the velocity has a median that means nothing; a bias that is named is named once.
        findings += closure_findings(closure, unbiased=bool(moves or biases))
    return BeamVerdict(full, matrix, matched, rows, closures, slope, blamed, orders, ambiguous, findings)
