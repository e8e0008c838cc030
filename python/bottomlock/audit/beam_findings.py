"""Findings from the beam matrix and the closure: order, signs, tilt, scale, bias, heavy tails."""

import numpy as np
from scipy.stats import binom, norm

from bottomlock.audit.beam_order import (
    NEAR_RAD,
    Match,
    closing_combination,
)
from bottomlock.audit.closure import GAUSSIAN_BEYOND_3, Closure, Slope, closure_of
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_RAD, MATERIAL_SCALE, SIGNIFICANCE, beam_words
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, READINGS_TO_VELOCITY, Matrix, tilt
from bottomlock.audit.robust import LEAST_BLOCKS, Array, sigmas_for
from bottomlock.recordings.closure import Order, closure_sd, orders_by_closure
from bottomlock.recordings.finding import Finding

BETTER, FAR_BETTER = 0.5, 0.2
"""An order is considered whose closure is smaller than this of the stated one's; of a matrix by regression, than this.

A fault of one channel in the record alone shows in every row of such a matrix, and another order may halve its closure.
"""

CLEARER = 2.0
"""A combination of readings is named where the next best spreads as many times more."""

HEAVY_FRACTION = 0.01
"""Heavy tails are reported when a larger fraction lies beyond three robust sigmas; Gaussian noise has 0.0027."""

ROUNDING_MPS = 1e-9
"""Beams that close as well as this close exactly: no other order closes better."""

FREE = (
    "Closure leaves 9 of the 12 entries of four beams free: a rotation, mirroring or stretch of the whole closes "
    "equally well; state a geometry, or record the instrument's velocity beside the beams."
)


def combination_findings(readings: Array) -> tuple[list[Finding], list[Closure]]:
    """Findings with neither a velocity nor a stated geometry: how readings (n, beams) of full pings close."""
    if readings.shape[1] < 4:
        note = Finding(
            "beams_alone", "note", 0.0,
            "The directions of three beams are not observable without the instrument's velocity or a stated geometry.",
            "Three beams have no closure.",
            "State a geometry.",
        )  # fmt: skip
        return [note], []
    best = closing_combination(readings)
    listed = " ".join(f"{w:+.2f}" for w in best.weights)
    clear = best.next_mps > max(MATERIAL_MPS, CLEARER * best.spread_mps)
    note = Finding(
        "beams_alone", "note", 0.0,
        f"The beams close with weights {listed}: of four beams of a Janus those of one sign face each other."
        if clear
        else "The order of the beams is not observable in this log: no combination of them closes clearly better than "
        "the others.",
        f"Of least spread are the weights {listed}: a unit combination closes to {1e3 * best.spread_mps:.1f} mm/s, the "
        f"next best to {1e3 * best.next_mps:.1f}. {FREE}",
        "Compare with the manufacturer's beam numbering, or state a geometry."
        if clear
        else "Record surge, sway and heave well above the noise.",
        size=best.spread_mps, unit="m/s",
    )  # fmt: skip
    if not clear:
        return [note], []
    closure = closure_of(best.weights, readings)
    # Fitted weights leave a part of the velocity in the closure, so that its median is no bias.
    return [note, *closure_findings(closure, unbiased=True)], [closure]


def order_findings(
    readings: Array, rows: Array, *, regressed: bool = False
) -> tuple[list[Finding], Array, bool]:
    """The simplest order in which the beams close far better than in the stated one, if any.

    A wrong order gives a steady course a constant closure, as a bias in the stated order does: where the closure of the
    stated order scatters about its median as little as the best closes, both are named.

    Args:
        readings: (n, beams) of full pings.
        rows: (beams, 3) in the stated order.
        regressed: the rows are a matrix by regression, not a stated geometry.

    Returns:
        The findings, the rows in the order that closes best, and whether it is ambiguous.
    """
    orders = orders_by_closure(readings, rows)
    plain, best = next(one for one in orders if one.steps == 0), orders[0]
    better = FAR_BETTER if regressed else BETTER
    if best.closure_mps > better * plain.closure_mps or plain.closure_mps < ROUNDING_MPS:
        return [], rows, False
    equal = [one for one in orders if one.closure_mps < 1.1 * best.closure_mps]
    fewest = min(one.steps for one in equal)
    simple = [one for one in equal if one.steps == fewest]
    named = "; or ".join(_order_words(one) for one in simple[:6])
    moved = {k for one in simple for k in range(len(rows)) if one.beam[k] != k or one.sign[k] < 0}
    chosen = simple[0]
    reordered = np.array(chosen.sign)[:, None] * rows[list(chosen.beam)]
    flips = any(s < 0 for s in chosen.sign)
    ratio = plain.closure_mps / max(best.closure_mps, 1e-12)
    scatter = closure_sd(rows, readings, biased=True)
    evidence = (
        f"Robust closure of a unit combination {1e3 * plain.closure_mps:.1f} mm/s as stated "
        f"({1e3 * scatter:.1f} about its median), {1e3 * best.closure_mps:.1f} mm/s after the change."
    )
    if BETTER * scatter < best.closure_mps:
        doubt = Finding(
            "order_or_bias", "fault", 1.0,
            f"Either the order is not the stated one ({named}), or the closure has a bias.",
            f"{evidence} The vehicle's velocity varies too little to decide.",
            "Record the vehicle on two courses, or the instrument's own velocity.",
            size=ratio, unit="times", beams=tuple(sorted(k + 1 for k in moved)),
        )  # fmt: skip
        return [doubt], rows, True
    finding = Finding(
        "sign_flipped" if flips and fewest == 1 else "swapped_beams", "fault", 1.0,
        f"The beams do not close as stated, and close {ratio:.1f} times better with {named}.",
        evidence,
        "Closure cannot distinguish these; record the instrument's velocity, or a known motion."
        if len(simple) > 1
        else "Use the geometry file that this audit writes.",
        size=ratio, unit="times", beams=tuple(sorted(k + 1 for k in moved)),
    )  # fmt: skip
    return [finding], reordered, len(simple) > 1


def _order_words(order: Order) -> str:
    flipped = [k for k, sign in enumerate(order.sign) if sign < 0]
    parts = []
    if order.moved:
        parts.append(f"{beam_words(order.moved)} exchanged")
    if flipped:
        parts.append(f"{beam_words(flipped)} flipped in sign")
    return " and ".join(parts)


def closure_findings(closure: Closure, *, unbiased: bool = False) -> list[Finding]:
    """A biased closure (unless it is already explained), or tails heavier than Gaussian ones."""
    found = []
    if not unbiased and abs(closure.median_mps) > max(
        MATERIAL_MPS, sigmas_for(closure.blocks) * closure.median_sd_mps
    ):
        found.append(
            Finding(
                "closure_bias", "warning", min(abs(closure.median_mps), 1.0),
                f"The median closure is {1e3 * closure.median_mps:+.1f} mm/s: at least one beam has a bias, or a scale "
                "or direction that a steady course shows as one.",
                f"± {1e3 * closure.median_sd_mps:.1g} mm/s over {closure.pings} pings. One combination of the biases "
                "is observable; the three that act like a velocity are not.",
                "Let the filter estimate beam biases; compare at rest on the bottom.",
                size=1e3 * closure.median_mps, unit="mm/s",
            )
        )  # fmt: skip
    surprise = _chance_of_tails(closure)
    if closure.beyond_3_sigma > HEAVY_FRACTION and surprise < SIGNIFICANCE:
        found.append(
            Finding(
                "heavy_tails", "warning", closure.beyond_3_sigma,
                f"The closure has heavy tails: {100.0 * closure.beyond_3_sigma:.2g} % of {closure.pings} pings "
                "lie beyond three robust "
                f"sigmas, {100.0 * GAUSSIAN_BEYOND_3:.2f} % would if the noise were Gaussian.",
                f"Median |e| {1e3 * closure.median_abs_mps:.1f}, robust sigma {1e3 * closure.sigma_mps:.1f}, 95 "
                f"% {1e3 * closure.p95_mps:.0f}, "
                f"99 % {1e3 * closure.p99_mps:.0f}, largest {1e3 * closure.max_mps:.0f} mm/s.",
                "Gate single beams, or use the heavy-tailed update; state the robust sigma as beam noise, not the RMS.",
                size=closure.beyond_3_sigma, unit="of pings",
            )
        )  # fmt: skip
    return found


def _chance_of_tails(closure: Closure) -> float:
    """Probability that Gaussian noise has as many pings beyond three robust sigmas.

    Correlated pings are worth fewer, and the robust sigma is itself known to 1.17 / √n only: the mean over its errors.
    """
    worth = max(closure.independent, 2.0)
    error = np.linspace(-6.0, 6.0, 121)
    wrong = np.maximum(1.0 + error * 1.17 / np.sqrt(worth), 0.0)
    tails = binom.sf(
        round(closure.beyond_3_sigma * worth) - 1, round(worth), np.minimum(2.0 * norm.sf(3.0 * wrong), 1.0)
    )
    return float(np.average(tails, weights=norm.pdf(error)))


def slope_findings(slope: Slope, velocity: Array) -> list[Finding]:
    """A closure that depends on the velocity: the beam directions or scales differ from the matrix."""
    effect = float(np.sqrt(slope.slope @ np.cov(velocity, rowvar=False) @ slope.slope))
    # A beam of full weight that is off by a direction or a scale, rad or relative, gives a slope of that size.
    size = float(np.linalg.norm(slope.slope))
    if slope.p_value > SIGNIFICANCE or size < MATERIAL_SCALE or effect < MATERIAL_MPS:
        return []
    sd = np.sqrt(np.diag(slope.cov))
    listed = ", ".join(f"{value:+.3f} ± {spread:.2g}" for value, spread in zip(slope.slope, sd, strict=True))
    return [
        Finding(
            "closure_depends_on_velocity", "fault", min(size, 1.0),
            f"The closure depends on the velocity, by {1e3 * effect:.0f} mm/s RMS: the directions or scales of the "
            "beams differ from the matrix.",
            f"Slope on x, y, z {listed} (p {slope.p_value:.1g}). Neighbours "
            f"{slope.lag} {'ping' if slope.lag == 1 else 'pings'} away serve as instrumental variable.",
            "Closure observes three numbers of the twelve and names no beam: check the beams against the "
            "manufacturer's drawing, or calibrate with a reference.",
            size=1e3 * effect, unit="mm/s",
        )
    ]  # fmt: skip


NOT_UNIQUE = (
    "It is the matrix of an instrument that solves these readings by least squares. With four beams a matrix with "
    "another multiple of the closure in each column fits as well, so that a channel changed after the instrument "
    "solved shows in every beam."
)


def unobservable_findings(log: BeamLog, matrix: Matrix | None, pings: int) -> list[Finding]:
    """Why beam directions are not observable in a log with the instrument's velocity: too few pings or motion."""
    if log.instrument_mps is None or not log.own_frame or log.beams < 3:
        return []
    if matrix is None:
        return [
            Finding(
                "too_few_pings", "note", 0.0,
                f"Beam directions are not observable in this log: only {pings} pings have all beams and the "
                "instrument's velocity.",
                f"At least {LEAST_PINGS} are needed.",
                "Record with bottom lock on all beams.",
                size=float(pings), unit="pings",
            )
        ]  # fmt: skip
    spread = log.instrument_mps[log.solved].std(axis=0)
    sd = np.rad2deg(matrix.direction_sd_rad)
    if matrix.blocks < LEAST_BLOCKS:
        return [
            Finding(
                "directions_not_observable", "note", 0.0,
                f"Beam directions are not observable in this log: the {pings} pings with all beams and the "
                "instrument's velocity are too few, or too correlated, for a standard deviation.",
                f"They are worth {matrix.blocks} independent blocks, needed are {LEAST_BLOCKS}.",
                "Record longer.",
                size=float(pings), unit="pings",
            )
        ]  # fmt: skip
    return [
        Finding(
            "directions_not_observable", "note", 0.0,
            "Beam directions are not observable in this log: the velocity varies too little.",
            f"Standard deviations {', '.join(f'{value:.2g}' for value in sd)} deg; the velocity varies by "
            f"{', '.join(f'{value:.2g}' for value in spread)} m/s in x, y, z.",
            "Record surge, sway and heave of a few decimetres per second.",
            size=float(sd.max()), unit="deg",
        )
    ]  # fmt: skip


def _degrees(values: Array, digits: int = 2) -> str:
    return ", ".join(f"{np.rad2deg(value):.{digits}f}" for value in values)


def match_findings(matrix: Matrix, matched: Match, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Differences from the stated geometry: common rotation, beams swapped, reversed or parallel."""
    found = []
    place = (
        f"Tilts {_degrees(matrix.tilt_rad)} deg, azimuths {_degrees(matrix.azimuth_rad, 1)} deg "
        f"from {matrix.pings} pings."
    )
    if matched.rotation.magnitude() > 1e-9:
        yaw, pitch, roll = matched.rotation.as_euler("ZYX", degrees=True)
        found.append(
            Finding(
                "rotated_geometry", "fault", 1.0,
                f"The beams match the stated ones only after a common rotation: roll {roll:.1f}, pitch {pitch:.1f}, "
                f"yaw {yaw:.1f} deg.",
                place,
                "State the mounting, or rotate the instrument's velocity to the stated frame.",
                size=float(np.rad2deg(matched.rotation.magnitude())), unit="deg",
            )
        )  # fmt: skip
    same = _same_way(matrix, copies)
    found += same
    parallel = {beam - 1 for one in same for beam in one.beams} | {
        beam - 1 for pair in copies for beam in pair
    }
    moved = [k for k, beam in enumerate(matched.beam) if beam != k and k not in parallel]
    if moved:
        pairs = ", ".join(f"channel {k + 1} is beam {matched.beam[k] + 1}" for k in moved)
        found.append(
            Finding(
                "swapped_beams", "fault", 1.0,
                f"The order is not the stated one: {pairs}.",
                place,
                "Use the geometry file that this audit writes, or correct the column map.",
                size=float(len(moved)), unit="beams", beams=tuple(k + 1 for k in moved),
            )
        )  # fmt: skip
    flipped = [int(k) for k in np.flatnonzero(matched.sign < 0) if int(k) not in parallel]
    if flipped:
        everything = len(flipped) == len(matched.sign)
        words = (
            "Every beam has the opposite sign of the stated geometry."
            if everything
            else f"{beam_words(flipped).capitalize()} {'has' if len(flipped) == 1 else 'have'} the opposite sign."
        )
        found.append(
            Finding(
                "all_signs_flipped" if everything else "sign_flipped", "fault", 1.0,
                words,
                place,
                "Use the geometry file that this audit writes.",
                size=float(len(flipped)), unit="beams", beams=tuple(k + 1 for k in flipped),
            )
        )  # fmt: skip
    return found


def parallel_beams(findings: list[Finding], copies: list[tuple[int, ...]]) -> set[int]:
    """Beams (from 0) of channels that are read twice."""
    same = [one.beams for one in findings if one.kind == "identical_beams"]
    return {beam - 1 for pair in [*same, *copies] for beam in pair}


def tilt_findings(matrix: Matrix, matched: Match, stated: Array, parallel: set[int]) -> list[Finding]:
    """Beams off their stated direction."""
    expected = matched.rotation.apply(matched.sign[:, None] * stated[matched.beam])
    sure = matched.off_rad > np.maximum(MATERIAL_RAD, sigmas_for(matrix.blocks) * matrix.direction_sd_rad)
    off = [int(k) for k in np.flatnonzero(sure) if int(k) not in parallel]
    if not off:
        return []
    # The tilt from the nearer end of the z axis, so that a reversed beam has the tilt of the others.
    lean, meant = (np.minimum(tilt(v), np.pi - tilt(v)) for v in (matrix.directions, expected))
    worst = max(off, key=lambda k: float(matched.off_rad[k]))
    listed = ", ".join(
        f"{np.rad2deg(matched.off_rad[k]):.2f} ± {np.rad2deg(matrix.direction_sd_rad[k]):.2g}" for k in off
    )
    return [
        Finding(
            "mistilted_beam", "fault", float(np.sin(matched.off_rad[worst])),
            f"In the matrix that the instrument uses {beam_words(off)} {'is' if len(off) == 1 else 'are'} off the "
            f"stated direction by up to {np.rad2deg(matched.off_rad[worst]):.2f} deg.",
            f"Off by {listed} deg; tilts {_degrees(lean)} deg, stated {_degrees(meant)}; azimuths "
            f"{_degrees(matrix.azimuth_rad, 1)} deg; from {matrix.pings} pings. {NOT_UNIQUE}",
            "Compare with the manufacturer's drawing; correct the stated geometry, or the channel.",
            size=float(np.rad2deg(matched.off_rad[worst])), unit="deg", beams=tuple(k + 1 for k in off),
        )
    ]  # fmt: skip


def _same_way(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Channels with different numbers but parallel (or antiparallel) directions."""
    found = []
    u = matrix.directions
    for i in range(len(u)):
        for j in range(i + 1, len(u)):
            angle = float(np.arccos(np.clip(abs(u[i] @ u[j]), 0.0, 1.0)))
            if angle < NEAR_RAD and (i + 1, j + 1) not in copies:
                found.append(
                    Finding(
                        "identical_beams", "fault", 1.0,
                        f"{beam_words([i, j]).capitalize()} are parallel within {np.rad2deg(angle):.2f} deg.",
                        f"± {np.rad2deg(np.hypot(*matrix.direction_sd_rad[[i, j]])):.2g} deg from "
                        f"{matrix.pings} pings.",
                        "One transducer is read twice: correct the wiring or the column map.",
                        size=float(np.rad2deg(angle)), unit="deg", beams=(i + 1, j + 1),
                    )
                )  # fmt: skip
    return found


def self_findings(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Beams that differ from the others, where no geometry is stated."""
    found = _same_way(matrix, copies)
    up = matrix.directions[:, 2] < 0.0
    if up.all() or (up.any() and up.sum() < len(up) / 2):
        reversed_ = [int(beam) for beam in np.flatnonzero(up)]
        found.append(
            Finding(
                "all_signs_flipped" if up.all() else "sign_flipped", "warning" if up.all() else "fault", 1.0,
                "Every beam is positive along −z: z points up, or readings are positive away from the bottom."
                if up.all()
                else f"{beam_words(reversed_).capitalize()} {'has' if len(reversed_) == 1 else 'have'} the opposite "
                "sign of the others.",
                f"Tilts {_degrees(matrix.tilt_rad)} deg.",
                "Use the geometry file that this audit writes; a recorded depth gives the direction of z.",
                size=float(len(reversed_)), unit="beams", beams=tuple(beam + 1 for beam in reversed_),
            )
        )  # fmt: skip
    return found


def scale_findings(matrix: Matrix, expected: Array | float = 1.0) -> list[Finding]:
    """Beams whose scale differs from the expected one (beams,) against the instrument's velocity."""
    off = matrix.scale / expected - 1.0
    sure = np.abs(off) > np.maximum(MATERIAL_SCALE, sigmas_for(matrix.blocks) * matrix.scale_sd)
    if not sure.any():
        return []
    k = [int(beam) for beam in np.flatnonzero(sure)]
    listed = ", ".join(f"{matrix.scale[b]:.4f} ± {matrix.scale_sd[b]:.1g}" for b in range(len(off)))
    return [
        Finding(
            "scale", "warning", float(np.abs(off).max()),
            f"The scale of {beam_words(k)} differs from that of the instrument's velocity by up to "
            f"{100.0 * off[np.argmax(np.abs(off))]:+.2f} %.",
            f"Scales {listed}.",
            "A common scale indicates a sound-speed correction of only one of the two; a single one a fault of that "
            "beam.",
            size=float(100.0 * np.abs(off).max()), unit="%", beams=tuple(b + 1 for b in k),
        )
    ]  # fmt: skip


def bias_findings(matrix: Matrix, closures: list[Closure]) -> list[Finding]:
    """Beams that are biased against the instrument's own velocity.

    The regression observes the biases that act like a velocity, the closure the rest. A bias that the instrument has
    included in its velocity is observed by the closure alone.
    """
    if not (
        np.abs(matrix.bias_mps) > np.maximum(MATERIAL_MPS, sigmas_for(matrix.blocks) * matrix.bias_sd_mps)
    ).any():
        return []
    bias, variance = matrix.bias_mps.copy(), matrix.bias_sd_mps**2
    # A regression of the readings holds the whole bias; one of the velocity lacks the part in the closure.
    for one in closures if matrix.regression == READINGS_TO_VELOCITY else []:
        share = one.weights / float(one.weights @ one.weights)
        bias += share * one.median_mps
        variance = variance + (share * one.median_sd_mps) ** 2
    sd = np.sqrt(variance)
    return [
        Finding(
            "beam_bias", "warning", float(min(abs(bias[k]), 1.0)),
            f"Beam {k + 1} has a bias of {1e3 * bias[k]:+.1f} mm/s against the instrument's velocity and the other "
            "beams.",
            f"± {1e3 * sd[k]:.1g} mm/s. The part that the instrument has included in its velocity is not observable.",
            "Subtract it, or let the filter estimate beam biases.",
            size=float(1e3 * bias[k]), unit="mm/s", beams=(int(k) + 1,),
        )
        for k in np.flatnonzero(np.abs(bias) > np.maximum(MATERIAL_MPS, sigmas_for(matrix.blocks) * sd))
    ]  # fmt: skip
