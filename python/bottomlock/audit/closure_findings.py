"""Findings from the closure: opposite beams, beam order, bias, heavy tails, and a beam with a wrong direction."""

import numpy as np
from scipy.stats import binom

from bottomlock.audit.beam_order import Order, closing_combination
from bottomlock.audit.closure import GAUSSIAN_BEYOND_3, Closure, Slope, Suspect, closure_of, null_space
from bottomlock.audit.findings import (
    MATERIAL_MPS,
    MATERIAL_RAD,
    MATERIAL_SCALE,
    SIGMAS,
    SIGNIFICANCE,
    Finding,
    beam_words,
)
from bottomlock.audit.robust import Array

HEAVY_FRACTION = 0.01
"""Heavy tails are reported when a larger fraction lies beyond three robust sigmas; Gaussian noise has 0.0027."""

ROUNDING_MPS = 1e-9
"""Beams that close as well as this close exactly: no other order closes better."""

FREE = (
    "Closure leaves 9 of the 12 entries of four beams free: a rotation, mirroring or stretch of the whole closes "
    "equally well; state a geometry, or record the instrument's velocity beside the beams."
)


def combination_findings(readings: Array) -> tuple[list[Finding], list[Closure]]:
    """Findings with neither a velocity nor a stated geometry: which beams are opposite each other."""
    if readings.shape[1] < 4:
        note = Finding(
            "beams_alone", "note", 0.0, "", 0.0,
            "The directions of three beams are not observable without the instrument's velocity or a stated geometry.",
            "Three beams have no closure.", "State a geometry.",
        )  # fmt: skip
        return [note], []
    best = closing_combination(readings)
    listed = " ".join(f"{w:+.2f}" for w in best.weights)
    evidence = (
        f"Weights {listed}; a unit combination closes to {1e3 * best.spread_mps:.1f} mm/s, "
        f"the next best to {1e3 * best.next_mps:.1f}. {FREE}"
    )
    if best.next_mps < 2.0 * best.spread_mps:
        return [
            Finding(
                "beams_alone", "note", best.spread_mps, "m/s", 0.0,
                "The order of the beams is not observable in this log: no combination of them closes clearly better "
                "than the others.",
                evidence, "Record surge, sway and heave well above the noise.",
            )
        ], []  # fmt: skip
    pairs = [np.flatnonzero(best.weights > 0.5), np.flatnonzero(best.weights < -0.5)]
    faces = readings.shape[1] == 4 and all(len(pair) == 2 for pair in pairs)
    words = (
        f"The beams close as a Janus in which {beam_words(pairs[0])} face each other, and {beam_words(pairs[1])}."
        if faces
        else f"The beams close with weights {listed}, which are not those of a Janus."
    )
    closure = closure_of(best.weights, readings)
    note = Finding(
        "beams_alone",
        "note" if faces else "warning",
        best.spread_mps,
        "m/s",
        0.0,
        words,
        evidence,
        "Compare with the manufacturer's beam numbering.",
    )
    return [note, *closure_findings(closure)], [closure]


def order_findings(orders: list[Order], rows: Array) -> tuple[list[Finding], Array, bool]:
    """The simplest order in which the beams close far better than in the stated one, if any.

    Returns the findings, the rows in that order, and whether other orders explain the closure as simply.
    """
    plain = next(one for one in orders if one.steps == 0)
    best = min(orders, key=lambda one: one.closure_mps)
    if best.closure_mps > 0.5 * plain.closure_mps or plain.closure_mps < ROUNDING_MPS:
        return [], rows, False
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
        f"The beams do not close as stated, and close {plain.closure_mps / max(best.closure_mps, 1e-12):.1f} "
        f"times better with {named}.",
        f"Robust closure of a unit combination {1e3 * plain.closure_mps:.1f} mm/s as stated, "
        f"{1e3 * best.closure_mps:.1f} mm/s after the change.",
        "Closure cannot distinguish these; record the instrument's velocity, or a known motion."
        if len(simple) > 1
        else "Use the geometry file that this audit writes.",
        tuple(sorted(k + 1 for k in moved)),
    )  # fmt: skip
    return [finding], np.array(chosen.sign)[:, None] * rows[list(chosen.beam)], len(simple) > 1


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
    """A biased closure (unless it is already explained), or tails heavier than Gaussian ones."""
    found = []
    if not unbiased and abs(closure.median_mps) > max(MATERIAL_MPS, SIGMAS * closure.median_sd_mps):
        found.append(
            Finding(
                "closure_bias", "warning", 1e3 * closure.median_mps, "mm/s", min(abs(closure.median_mps), 1.0),
                f"The median closure is {1e3 * closure.median_mps:+.1f} mm/s: at least one beam is biased.",
                f"± {1e3 * closure.median_sd_mps:.1g} mm/s over {closure.pings} pings. One combination of the biases "
                "is observable; the three that act like a velocity are not.",
                "Let the filter estimate beam biases; compare at rest on the bottom.",
            )
        )  # fmt: skip
    beyond = round(closure.beyond_3_sigma * closure.pings)
    surprise = binom.sf(beyond - 1, closure.pings, GAUSSIAN_BEYOND_3)
    if closure.beyond_3_sigma > HEAVY_FRACTION and surprise < SIGNIFICANCE:
        found.append(
            Finding(
                "heavy_tails", "warning", closure.beyond_3_sigma, "of pings", closure.beyond_3_sigma,
                f"The closure has heavy tails: {100.0 * closure.beyond_3_sigma:.2g} % of {closure.pings} pings "
                "lie beyond three robust "
                f"sigmas, {100.0 * GAUSSIAN_BEYOND_3:.2f} % would if the noise were Gaussian.",
                f"Median |e| {1e3 * closure.median_abs_mps:.1f}, robust sigma {1e3 * closure.sigma_mps:.1f}, 95 "
                f"% {1e3 * closure.p95_mps:.0f}, "
                f"99 % {1e3 * closure.p99_mps:.0f}, largest {1e3 * closure.max_mps:.0f} mm/s.",
                "Gate single beams, or use the heavy-tailed update; state the robust sigma as beam noise, not the RMS.",
            )
        )  # fmt: skip
    return found


def slope_findings(slope: Slope, blamed: list[Suspect], rows: Array, velocity: Array) -> list[Finding]:
    """A closure that depends on the velocity: the beam directions or scales differ from the matrix."""
    effect = float(np.sqrt(slope.slope @ np.cov(velocity, rowvar=False) @ slope.slope))
    best = blamed[0]
    turned = best.p_turned >= best.p_scaled
    size = best.angle_rad if turned else abs(best.scale)
    if size < (MATERIAL_RAD if turned else MATERIAL_SCALE) or effect < MATERIAL_MPS:
        return []
    fitting = [one for one in blamed if max(one.p_turned, one.p_scaled) > 0.01]
    named = []
    for one in fitting:
        options = []
        if one.p_turned > 0.01:
            options.append(
                f"the direction of beam {one.beam + 1} off by {np.rad2deg(one.angle_rad):.1f} ± "
                f"{np.rad2deg(one.angle_sd_rad):.1g} deg "
                f"({np.rad2deg(one.tilt_change_rad):+.1f} deg of it tilt; p {one.p_turned:.2g})"
            )
        if one.p_scaled > 0.01:
            options.append(
                f"the scale of beam {one.beam + 1} off by {100.0 * one.scale:+.1f} % (p {one.p_scaled:.2g})"
            )
        named += options
    words = " or ".join(named) if named else "no single beam explains it"
    sd = np.sqrt(np.diag(slope.cov))
    listed = ", ".join(f"{value:+.3f} ± {spread:.2g}" for value, spread in zip(slope.slope, sd, strict=True))
    return [
        Finding(
            "closure_depends_on_velocity" if not named else ("mistilted_beam" if turned else "beam_scale"), "fault",
            float(np.rad2deg(size)) if turned else 100.0 * size, "deg" if turned else "%",
            float(min(np.linalg.norm(slope.slope) / np.sum(np.abs(null_space(rows)[:, 0])), 1.0)),
            f"The closure depends on the velocity: the beams differ from the matrix. Possible cause: {words}.",
            f"Slope on x, y, z {listed} (p {slope.p_value:.1g}); {1e3 * effect:.0f} mm/s RMS of closure.",
            "Closure observes one combination of three numbers: check the named beam against the manufacturer's "
            "drawing, or calibrate with a reference.",
            tuple(one.beam + 1 for one in fitting[:1]) if named else (),
        )
    ]  # fmt: skip
