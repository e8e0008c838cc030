"""Findings from the closure: opposite beams, beam order, bias, heavy tails, and beams that differ from the matrix."""

import numpy as np
from scipy.stats import binom, norm

from bottomlock.audit.beam_order import Order, closing_combination, closure_size, orders_by_closure
from bottomlock.audit.closure import GAUSSIAN_BEYOND_3, Closure, Slope, closure_of
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_SCALE, SIGNIFICANCE, beam_words
from bottomlock.audit.robust import Array, sigmas_for
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
    scatter = closure_size(readings, rows, biased=True)
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
