"""Judgement on the beams of a log: which matrix, which order, which beam is off its place."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from bottomlock.audit.closure import (
    GAUSSIAN_BEYOND_3,
    Closure,
    Slope,
    Suspect,
    closure_of,
    closure_slope,
    null_space,
    null_space_cov,
    suspects,
)
from bottomlock.audit.findings import SIGNIFICANCE, Finding, beam_words
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, Matrix, find_matrix, tilt
from bottomlock.audit.orders import NEAR_RAD, Match, Order, closing_combination, match, orders_by_closure
from bottomlock.audit.robust import Array

SIGMAS = 5.0
MATERIAL_RAD, MATERIAL_SCALE, MATERIAL_MPS = np.deg2rad(0.5), 0.005, 0.002
"""What is smaller is left unsaid, however sure: 0.5° of tilt is 2 % of surge at 25°; 0.5 % of scale; 2 mm/s of bias."""
HEAVY_PART = 0.01
"""Heavy tails are named when more than this lies beyond three robust sigmas; Gaussian noise has 0.0027."""


@dataclass(frozen=True, eq=False)
class BeamVerdict:
    """What the beams of a log say.

    Attributes:
        full: (n,) pings that were used: every beam valid, not stale, none exactly zero.
        matrix: the beams as the instrument's velocity sees them, or None.
        match: of the matrix with the stated geometry, or None.
        rows: (beams, 3) geometry that the rest was judged with, in the order and with the signs of the log; or None.
        closures: statistics, one for each combination that no velocity moves; empty for three beams.
        slope: of the first closure on the velocity, or None.
        suspects: single beams that would explain the slope; empty where it is not significant.
        orders: orders by closure, the best first; empty where they were not tried.
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
    matrix, matched = None, None
    solved = full & log.solved
    if log.instrument_mps is not None and log.own_frame and log.beams >= 3:
        matrix = find_matrix(log.velocity_mps[solved], log.instrument_mps[solved])
    if matrix is not None and matrix.observable.all():
        if stated is not None:
            matched = match(matrix.directions, stated)
            findings += _match_findings(matrix, matched, stated, copies)
        else:
            findings += _self_findings(matrix, copies)
        findings += _scale_findings(matrix)
        rows = matrix.rows
    else:
        findings += _unobservable(log, matrix, int(solved.sum()))
        rows = None if stated is None else np.array(stated)
    orders: list[Order] = []
    same_way = bool(copies) or any(one.kind == "identical_beams" for one in findings)
    if full.sum() < LEAST_PINGS or same_way:
        return BeamVerdict(full, matrix, matched, rows, findings=findings)
    readings = log.velocity_mps[full]
    if rows is None:
        found, closures = _combination_findings(readings)
        return BeamVerdict(full, matrix, closures=closures, findings=findings + found)
    if log.beams >= 4:
        orders = orders_by_closure(readings, rows)
        found, rows = _order_findings(orders, rows)
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
            moves = _slope_findings(slope, blamed, rows, velocity)
    biases = [] if matrix is None or rows is not matrix.rows else _bias_findings(matrix, closures)
    findings += moves + biases
    for closure in closures:
        # A closure that moves with the velocity has a median that means nothing; a bias that is named is named once.
        findings += closure_findings(closure, unbiased=bool(moves or biases))
    return BeamVerdict(full, matrix, matched, rows, closures, slope, blamed, orders, findings)


def _unobservable(log: BeamLog, matrix: Matrix | None, pings: int) -> list[Finding]:
    if log.instrument_mps is None or not log.own_frame or log.beams < 3:
        return []
    if matrix is None:
        return [
            Finding(
                "too_few_pings", "note", float(pings), "pings", 0.0,
                f"Only {pings} pings have all beams and the instrument's velocity: directions are not observable in this log.",
                f"{LEAST_PINGS} are the least that is used.", "Record with lock on all beams.",
            )
        ]  # fmt: skip
    spread = log.instrument_mps[log.solved].std(axis=0)
    sd = np.rad2deg(matrix.direction_sd_rad)
    return [
        Finding(
            "directions_not_observable", "note", float(sd.max()), "deg", 0.0,
            "Beam directions are not observable in this log: it moves too little.",
            f"Standard deviations {', '.join(f'{value:.2g}' for value in sd)} deg; the velocity varies by "
            f"{', '.join(f'{value:.2g}' for value in spread)} m/s in x, y, z.",
            "Record surge, sway and heave of a few decimetres per second.",
        )
    ]  # fmt: skip


def _degrees(values: Array, digits: int = 2) -> str:
    return ", ".join(f"{np.rad2deg(value):.{digits}f}" for value in values)


def _match_findings(
    matrix: Matrix, matched: Match, stated: Array, copies: list[tuple[int, ...]]
) -> list[Finding]:
    found = []
    place = f"Tilts {_degrees(matrix.tilt_rad)} deg, azimuths {_degrees(matrix.azimuth_rad, 1)} deg from {matrix.pings} pings."
    if matched.turn.magnitude() > 1e-9:
        yaw, pitch, roll = matched.turn.as_euler("ZYX", degrees=True)
        found.append(
            Finding(
                "turned_as_a_whole", "fault", float(np.rad2deg(matched.turn.magnitude())), "deg", 1.0,
                f"The beams fit the stated ones only when these are turned as a whole: roll {roll:.1f}, pitch {pitch:.1f}, yaw {yaw:.1f} deg.",
                place, "State the mounting, or bring the instrument's velocity into the stated frame.",
            )
        )  # fmt: skip
    same = _same_way(matrix, copies)
    found += same
    twins = {beam - 1 for one in same for beam in one.beams} | {beam - 1 for pair in copies for beam in pair}
    moved = [k for k, beam in enumerate(matched.beam) if beam != k and k not in twins]
    if moved:
        pairs = ", ".join(f"channel {k + 1} is beam {matched.beam[k] + 1}" for k in moved)
        found.append(
            Finding(
                "swapped_beams", "fault", float(len(moved)), "beams", 1.0,
                f"The order is not the stated one: {pairs}.", place,
                "Use the geometry file that this audit writes, or mend the column map.", tuple(k + 1 for k in moved),
            )
        )  # fmt: skip
    flipped = [int(k) for k in np.flatnonzero(matched.sign < 0) if int(k) not in twins]
    if flipped:
        everything = len(flipped) == len(matched.sign)
        words = (
            "Every beam reads positive the other way than stated."
            if everything
            else f"{beam_words(flipped).capitalize()} {'reads' if len(flipped) == 1 else 'read'} with the sign flipped."
        )
        found.append(
            Finding(
                "all_signs_flipped" if everything else "sign_flipped", "fault", float(len(flipped)), "beams", 1.0,
                words, place, "Use the geometry file that this audit writes.", tuple(k + 1 for k in flipped),
            )
        )  # fmt: skip
    for k in np.flatnonzero(matched.off_rad > np.maximum(MATERIAL_RAD, SIGMAS * matrix.direction_sd_rad)):
        if int(k) in twins:
            continue
        expected = matched.turn.apply(matched.sign[k] * stated[matched.beam[k]])
        change = matrix.tilt_rad[k] - tilt(expected)
        found.append(
            Finding(
                "mistilted_beam", "fault", float(np.rad2deg(matched.off_rad[k])), "deg", float(np.sin(matched.off_rad[k])),
                f"Beam {k + 1} looks {np.rad2deg(matched.off_rad[k]):.2f} deg off its stated direction "
                f"(tilt {np.rad2deg(matrix.tilt_rad[k]):.2f} deg instead of {np.rad2deg(tilt(expected)):.2f}).",
                f"± {np.rad2deg(matrix.direction_sd_rad[k]):.2g} deg; {np.rad2deg(change):+.2f} deg of it is tilt. {place}",
                "This is the matrix that the instrument uses; correct the stated geometry.", (int(k) + 1,),
            )
        )  # fmt: skip
    return found


def _same_way(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Channels that are not the same numbers but look the same way (or just the other)."""
    found = []
    u = matrix.directions
    for i in range(len(u)):
        for j in range(i + 1, len(u)):
            angle = float(np.arccos(np.clip(abs(u[i] @ u[j]), 0.0, 1.0)))
            if angle < NEAR_RAD and (i + 1, j + 1) not in copies:
                found.append(
                    Finding(
                        "identical_beams", "fault", float(np.rad2deg(angle)), "deg", 1.0,
                        f"{beam_words([i, j]).capitalize()} look the same way, within {np.rad2deg(angle):.2f} deg.",
                        f"± {np.rad2deg(np.hypot(*matrix.direction_sd_rad[[i, j]])):.2g} deg from {matrix.pings} pings.",
                        "One transducer is read twice: mend the wiring or the column map.", (i + 1, j + 1),
                    )
                )  # fmt: skip
    return found


def _self_findings(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """What stands out among the beams themselves when no geometry is stated."""
    found = _same_way(matrix, copies)
    twins = {beam for one in found for beam in one.beams} | {beam for pair in copies for beam in pair}
    up = matrix.directions[:, 2] < 0.0
    if up.all() or (up.any() and up.sum() < len(up) / 2):
        k = [int(beam) for beam in np.flatnonzero(up)]
        found.append(
            Finding(
                "all_signs_flipped" if up.all() else "sign_flipped", "warning" if up.all() else "fault",
                float(len(k)), "beams", 1.0,
                "Every beam reads positive along −z: z is up, or readings are positive towards the instrument."
                if up.all()
                else f"{beam_words(k).capitalize()} read the other way than the rest.",
                f"Tilts {_degrees(matrix.tilt_rad)} deg.",
                "Use the geometry file that this audit writes; the depth rate tells which way z points.",
                tuple(beam + 1 for beam in k),
            )
        )  # fmt: skip
    lean = np.where(up, np.pi - matrix.tilt_rad, matrix.tilt_rad)
    for k in range(len(lean)):
        others = np.delete(lean, k)
        off = float(lean[k] - np.median(others))
        alike = float(np.max(np.abs(others - np.median(others))))
        if k + 1 not in twins and abs(off) > max(2.0 * MATERIAL_RAD, SIGMAS * matrix.direction_sd_rad[k], 3.0 * alike):
            found.append(
                Finding(
                    "mistilted_beam", "warning", float(np.rad2deg(abs(off))), "deg", abs(float(np.sin(off))),
                    f"Beam {k + 1} has a tilt of {np.rad2deg(lean[k]):.2f} deg, the others {_degrees(others)}.",
                    f"± {np.rad2deg(matrix.tilt_sd_rad[k]):.2g} deg from {matrix.pings} pings.",
                    "Compare with the maker's drawing; this is the matrix that the instrument uses.", (k + 1,),
                )
            )  # fmt: skip
    return found


def _scale_findings(matrix: Matrix) -> list[Finding]:
    off = matrix.scale - 1.0
    sure = np.abs(off) > np.maximum(MATERIAL_SCALE, SIGMAS * matrix.scale_sd)
    if not sure.any():
        return []
    k = [int(beam) for beam in np.flatnonzero(sure)]
    listed = ", ".join(f"{matrix.scale[b]:.4f} ± {matrix.scale_sd[b]:.1g}" for b in range(len(off)))
    return [
        Finding(
            "scale", "warning", float(100.0 * np.abs(off).max()), "%", float(np.abs(off).max()),
            f"{beam_words(k).capitalize()} {'differs' if len(k) == 1 else 'differ'} in scale from the instrument's velocity "
            f"by up to {100.0 * off[np.argmax(np.abs(off))]:+.2f} %.",
            f"Scales {listed}.",
            "A common scale is a sound speed that one of the two was not corrected for; a single one is a fault of that beam.",
            tuple(b + 1 for b in k),
        )
    ]  # fmt: skip


def _bias_findings(matrix: Matrix, closures: list[Closure]) -> list[Finding]:
    """Beams that are biased against the instrument's own velocity.

    The regression sees the biases that look like a velocity, the closure sees the rest; together they are whole. A bias that
    the instrument has taken into its velocity is not seen by the first: then only the closure speaks.
    """
    if not (np.abs(matrix.bias_mps) > np.maximum(MATERIAL_MPS, SIGMAS * matrix.bias_sd_mps)).any():
        return []
    bias, variance = matrix.bias_mps.copy(), matrix.bias_sd_mps**2
    for one in closures:
        share = one.weights / float(one.weights @ one.weights)
        bias += share * one.median_mps
        variance = variance + (share * one.median_sd_mps) ** 2
    sd = np.sqrt(variance)
    return [
        Finding(
            "beam_bias", "warning", float(1e3 * bias[k]), "mm/s", float(min(abs(bias[k]), 1.0)),
            f"Beam {k + 1} reads {1e3 * bias[k]:+.1f} mm/s where the instrument's velocity and the other beams ask for zero.",
            f"± {1e3 * sd[k]:.1g} mm/s. What the instrument has taken into its own velocity is not in it.",
            "Subtract it, or let the filter estimate beam biases.", (int(k) + 1,),
        )
        for k in np.flatnonzero(np.abs(bias) > np.maximum(MATERIAL_MPS, SIGMAS * sd))
    ]  # fmt: skip


FREE = (
    "Closure leaves 9 of the 12 numbers of four beams free: every turn, mirror and stretch of the whole closes alike; "
    "state a geometry, or record the instrument's velocity beside the beams."
)


def _combination_findings(readings: Array) -> tuple[list[Finding], list[Closure]]:
    """What beams say with neither a velocity nor a stated geometry: which of them face each other."""
    if readings.shape[1] < 4:
        note = Finding(
            "beams_alone", "note", 0.0, "", 0.0,
            "Three beams without a velocity or a geometry beside them say nothing of their directions.",
            "They have no closure.", "State a geometry.",
        )  # fmt: skip
        return [note], []
    best = closing_combination(readings)
    listed = " ".join(f"{w:+.2f}" for w in best.weights)
    evidence = f"Weights {listed}; a unit combination closes to {1e3 * best.spread_mps:.1f} mm/s, the next best to {1e3 * best.next_mps:.1f}. {FREE}"
    if best.next_mps < 2.0 * best.spread_mps:
        return [
            Finding(
                "beams_alone", "note", best.spread_mps, "m/s", 0.0,
                "No combination of the beams closes clearly better than the others: nothing of their order is observable in this log.",
                evidence, "Record surge, sway and heave well above the noise.",
            )
        ], []  # fmt: skip
    pairs = [np.flatnonzero(best.weights > 0.5), np.flatnonzero(best.weights < -0.5)]
    faces = readings.shape[1] == 4 and all(len(pair) == 2 for pair in pairs)
    words = (
        f"The beams close as those of a Janus do in which {beam_words(pairs[0])} face each other, and {beam_words(pairs[1])}."
        if faces
        else f"The beams close with weights {listed}, which are not those of a Janus."
    )
    closure = closure_of(best.weights, readings)
    note = Finding("beams_alone", "note" if faces else "warning", best.spread_mps, "m/s", 0.0, words, evidence, "Compare with the maker's numbering.")
    return [note, *closure_findings(closure)], [closure]


def _order_findings(orders: list[Order], rows: Array) -> tuple[list[Finding], Array]:
    """Is there an order, simpler than others that do as well, in which the beams close better than in this one?"""
    plain = next(one for one in orders if one.steps == 0)
    best = min(orders, key=lambda one: one.closure_mps)
    if best.closure_mps > 0.5 * plain.closure_mps:
        return [], rows
    equal = [one for one in orders if one.closure_mps < 1.1 * best.closure_mps]
    fewest = min(one.steps for one in equal)
    simple = [one for one in equal if one.steps == fewest]
    named = "; or ".join(_order_words(one) for one in simple[:6])
    moved = {k for one in simple for k in range(len(rows)) if one.beam[k] != k or one.sign[k] < 0}
    chosen = simple[0]
    flips = any(s < 0 for s in chosen.sign)
    finding = Finding(
        "sign_flipped" if flips and fewest == 1 else "swapped_beams", "fault",
        plain.closure_mps / max(best.closure_mps, 1e-12), "times", 1.0,
        f"The beams do not close as stated, and close {plain.closure_mps / max(best.closure_mps, 1e-12):.1f} times better with {named}.",
        f"Robust closure of a unit combination {1e3 * plain.closure_mps:.1f} mm/s as stated, {1e3 * best.closure_mps:.1f} mm/s so.",
        "Closure cannot choose between these; a log with the instrument's velocity, or a known motion, can."
        if len(simple) > 1
        else "Use the geometry file that this audit writes.",
        tuple(sorted(k + 1 for k in moved)),
    )  # fmt: skip
    return [finding], np.array(chosen.sign)[:, None] * rows[list(chosen.beam)]


def _order_words(order: Order) -> str:
    moved = [k for k, beam in enumerate(order.beam) if beam != k]
    flipped = [k for k, sign in enumerate(order.sign) if sign < 0]
    parts = []
    if moved:
        parts.append(f"{beam_words(moved)} exchanged")
    if flipped:
        parts.append(f"{beam_words(flipped)} flipped in sign")
    return " and ".join(parts)


def closure_findings(closure: Closure, *, unbiased: bool = False) -> list[Finding]:
    """A closure that is biased (unless that is explained), or whose tails are heavier than Gaussian ones."""
    found = []
    if not unbiased and abs(closure.median_mps) > max(MATERIAL_MPS, SIGMAS * closure.median_sd_mps):
        found.append(
            Finding(
                "closure_bias", "warning", 1e3 * closure.median_mps, "mm/s", min(abs(closure.median_mps), 1.0),
                f"The closure is {1e3 * closure.median_mps:+.1f} mm/s in the median: one beam at least is biased.",
                f"± {1e3 * closure.median_sd_mps:.1g} mm/s over {closure.pings} pings. One combination of the biases is seen; "
                "the three that look like a velocity are not.",
                "Let the filter estimate beam biases; compare at rest on the bottom.",
            )
        )  # fmt: skip
    beyond = round(closure.beyond_3_sigma * closure.pings)
    surprise = binom.sf(beyond - 1, closure.pings, GAUSSIAN_BEYOND_3)
    if closure.beyond_3_sigma > HEAVY_PART and surprise < SIGNIFICANCE:
        found.append(
            Finding(
                "heavy_tails", "warning", closure.beyond_3_sigma, "of pings", closure.beyond_3_sigma,
                f"The closure has heavy tails: {100.0 * closure.beyond_3_sigma:.2g} % of {closure.pings} pings lie beyond three robust "
                f"sigmas, {GAUSSIAN_BEYOND_3:.2%} would if the noise were Gaussian.",
                f"Median |e| {1e3 * closure.median_abs_mps:.1f}, robust sigma {1e3 * closure.sigma_mps:.1f}, 95 % {1e3 * closure.p95_mps:.0f}, "
                f"99 % {1e3 * closure.p99_mps:.0f}, largest {1e3 * closure.max_mps:.0f} mm/s.",
                "Gate beam by beam, or use the heavy-tailed update; state the robust sigma as beam noise, not the rms.",
            )
        )  # fmt: skip
    return found


def _slope_findings(slope: Slope, blamed: list[Suspect], rows: Array, velocity: Array) -> list[Finding]:
    """The closure moves with the velocity: the beams do not sit as the matrix says."""
    effect = float(np.sqrt(slope.slope @ np.cov(velocity, rowvar=False) @ slope.slope))
    best = blamed[0]
    turned = best.p_turned >= best.p_scaled
    size = best.angle_rad if turned else abs(best.scale)
    if size < (MATERIAL_RAD if turned else MATERIAL_SCALE) or effect < MATERIAL_MPS:
        return []
    fitting = [one for one in blamed if max(one.p_turned, one.p_scaled) > 0.01]
    named = []
    for one in fitting:
        ways = []
        if one.p_turned > 0.01:
            ways.append(
                f"beam {one.beam + 1} turned by {np.rad2deg(one.angle_rad):.1f} ± {np.rad2deg(one.angle_sd_rad):.1g} deg "
                f"({np.rad2deg(one.tilt_change_rad):+.1f} deg of it tilt; p {one.p_turned:.2g})"
            )
        if one.p_scaled > 0.01:
            ways.append(f"beam {one.beam + 1} off in scale by {100.0 * one.scale:+.1f} % (p {one.p_scaled:.2g})")
        named += ways
    words = " or ".join(named) if named else "no single beam explains it"
    sd = np.sqrt(np.diag(slope.cov))
    listed = ", ".join(f"{value:+.3f} ± {spread:.2g}" for value, spread in zip(slope.slope, sd, strict=True))
    return [
        Finding(
            "closure_moves_with_velocity" if not named else ("mistilted_beam" if turned else "beam_scale"), "fault",
            float(np.rad2deg(size)) if turned else 100.0 * size, "deg" if turned else "%",
            float(min(np.linalg.norm(slope.slope) / np.sum(np.abs(null_space(rows)[:, 0])), 1.0)),
            f"The closure moves with the velocity: the beams do not sit as the matrix says. It fits {words}.",
            f"Slope on x, y, z {listed} (p {slope.p_value:.1g}); {1e3 * effect:.0f} mm/s rms of closure.",
            "Closure sees one combination of three numbers: check the beam named against the maker's drawing, or calibrate with a reference.",
            tuple(one.beam + 1 for one in fitting[:1]) if named else (),
        )
    ]  # fmt: skip
