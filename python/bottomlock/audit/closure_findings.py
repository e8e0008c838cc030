"""Findings from the closure: opposite beams, beam order, bias, heavy tails, and a beam with a wrong direction."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, norm

from bottomlock.audit.beam_order import Order, closing_combination
from bottomlock.audit.closure import GAUSSIAN_BEYOND_3, Closure, Slope, Suspect, closure_of, null_space
from bottomlock.audit.findings import (
    MATERIAL_MPS,
    MATERIAL_RAD,
    MATERIAL_SCALE,
    SIGNIFICANCE,
    beam_words,
)
from bottomlock.audit.nearest_janus import nearest_janus
from bottomlock.audit.order_odds import BETTER, Odds
from bottomlock.audit.robust import Array, sigmas_for
from bottomlock.recordings.finding import Finding

HEAVY_FRACTION = 0.01
"""Heavy tails are reported when a larger fraction lies beyond three robust sigmas; Gaussian noise has 0.0027."""

NAMED_SIGMAS = 3.0
"""A beam is named as the cause whose scale or direction is off by as many of its standard deviations."""

ROUNDING_MPS = 1e-9
"""Beams that close as well as this close exactly: no other order closes better."""

FREE = (
    "Closure leaves 9 of the 12 entries of four beams free: a rotation, mirroring or stretch of the whole closes "
    "equally well; state a geometry, or record the instrument's velocity beside the beams."
)


def combination_findings(readings: Array, row: NDArray[np.int64]) -> tuple[list[Finding], list[Closure]]:
    """Findings with neither a velocity nor a stated geometry: which beams are opposite each other.

    Args:
        readings: (n, beams) of full pings.
        row: (n,) their rows in the log.
    """
    if readings.shape[1] < 4:
        note = Finding(
            "beams_alone", "note", 0.0,
            "The directions of three beams are not observable without the instrument's velocity or a stated geometry.",
            "Three beams have no closure.",
            "State a geometry.",
        )  # fmt: skip
        return [note], []
    found = nearest_janus(readings, row)
    best = closing_combination(readings)
    listed = " ".join(f"{w:+.2f}" for w in best.weights)
    evidence = (
        f"Of least spread are the weights {listed}: a unit combination closes to {1e3 * best.spread_mps:.1f} mm/s, "
        f"the next best to {1e3 * best.next_mps:.1f}. {FREE}"
    )
    moved = best.next_mps > MATERIAL_MPS
    if readings.shape[1] != 4 or found is None or not moved:
        clear = moved and readings.shape[1] > 4 and best.next_mps > 2.0 * best.spread_mps
        words = (
            f"The beams close with weights {listed}."
            if clear
            else "The order of the beams is not observable in this log: no combination of them closes clearly better "
            "than the others."
        )
        advice = "State a geometry." if clear else "Record surge, sway and heave well above the noise."
        return [
            Finding(
                "beams_alone",
                "note",
                0.0,
                words,
                evidence,
                advice,
                size=best.spread_mps,
                unit="m/s",
            )
        ], []
    pairs = [np.flatnonzero(found.weights > 0.0), np.flatnonzero(found.weights < 0.0)]
    faces = f"{beam_words(pairs[0])} face each other, and {beam_words(pairs[1])}"
    words = f"The beams close as a Janus in which {faces}."
    if found.departs:
        words = (
            f"The beams are nearest to a Janus in which {faces}, but its closure follows the velocity: a beam has "
            "another scale or direction, or the instrument is no Janus."
        )
        assert found.slope is not None
        evidence = (
            f"{1e3 * found.effect_mps:.0f} mm/s RMS of closure (p {found.slope.p_value:.1g}). {evidence}"
        )
    closure = closure_of(found.weights, readings)
    note = Finding(
        "beams_alone",
        "warning" if found.departs else "note",
        0.0,
        words,
        f"Probability of this pairing {found.share:.4g}. {evidence}",
        "Compare with the manufacturer's beam numbering.",
        size=best.spread_mps,
        unit="m/s",
    )
    return [note, *closure_findings(closure, unbiased=found.departs)], [closure]


def order_findings(orders: list[Order], odds: Odds | None, rows: Array) -> tuple[list[Finding], Array, bool]:
    """The simplest order in which the beams close far better than in the stated one, if any.

    A closure that is not zero may also be a bias in the stated order: where the log does not exclude it, both are named
    with their odds. Returns the findings, the rows in the order that is more probable, and whether it is ambiguous.
    """
    plain = next(one for one in orders if one.steps == 0)
    best = min(orders, key=lambda one: one.closure_mps)
    if best.closure_mps > BETTER * plain.closure_mps or plain.closure_mps < ROUNDING_MPS:
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
    evidence = (
        f"Robust closure of a unit combination {1e3 * plain.closure_mps:.1f} mm/s as stated, "
        f"{1e3 * best.closure_mps:.1f} mm/s after the change."
    )
    stays = -np.inf if odds is None else odds.log_stated
    if odds is not None and stays > np.log(SIGNIFICANCE):
        doubt = Finding(
            "order_or_bias", "fault", 1.0,
            f"Either the order is not the stated one ({named}: probability {-np.expm1(stays):.2g}), or the closure has "
            f"a bias of {1e3 * odds.bias_mps:+.1f} mm/s (probability {np.exp(stays):.2g}).",
            f"{evidence} The vehicle's velocity varies too little to decide.",
            "Record the vehicle on two courses, or the instrument's own velocity.",
            size=ratio, unit="times", beams=tuple(sorted(k + 1 for k in moved)),
        )  # fmt: skip
        return [doubt], reordered if stays < np.log(0.5) else rows, True
    finding = Finding(
        "sign_flipped" if flips and fewest == 1 else "swapped_beams", "fault", 1.0,
        f"The beams do not close as stated, and close {ratio:.1f} times better with {named}.",
        f"{evidence} A bias in the stated order instead: odds {_odds_words(stays)}.",
        "Closure cannot distinguish these; record the instrument's velocity, or a known motion."
        if len(simple) > 1
        else "Use the geometry file that this audit writes.",
        size=ratio, unit="times", beams=tuple(sorted(k + 1 for k in moved)),
    )  # fmt: skip
    return [finding], reordered, len(simple) > 1


def _odds_words(log_share: float) -> str:
    """Odds against, in words.

    >>> _odds_words(np.log(1e-7)), _odds_words(-np.inf)
    ('1 in 1e+07', 'none')
    """
    if not np.isfinite(log_share):
        return "none"
    digits = -log_share / np.log(10.0)
    return f"1 in {np.exp(-log_share):.0e}" if digits < 300 else f"1 in 10^{digits:.0f}"


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


class _Cause(NamedTuple):
    """A beam that may explain a slope: its share among all, the probability, its size in standard deviations, words."""

    share: float
    p_value: float
    sigmas: float
    beam: int
    words: str


def slope_findings(slope: Slope, blamed: list[Suspect], rows: Array, velocity: Array) -> list[Finding]:
    """A closure that depends on the velocity: the beam directions or scales differ from the matrix."""
    effect = float(np.sqrt(slope.slope @ np.cov(velocity, rowvar=False) @ slope.slope))
    best = blamed[0]
    turned = best.share_turned >= best.share_scaled
    size = best.angle_rad if turned else abs(best.scale)
    if size < (MATERIAL_RAD if turned else MATERIAL_SCALE) or effect < MATERIAL_MPS:
        return []
    # A share compares single beams with each other; the probability says whether the beam explains the slope at all.
    causes = [
        *(
            _Cause(
                one.share_turned, one.p_turned, one.angle_rad / one.angle_sd_rad, one.beam, _turned_words(one)
            )
            for one in blamed
        ),
        *(
            _Cause(one.share_scaled, one.p_scaled, one.scale / one.scale_sd, one.beam, _scaled_words(one))
            for one in blamed
        ),
    ]
    causes = sorted(
        (one for one in causes if one.share > 0.01 and one.p_value > 1e-3), key=lambda one: -one.share
    )
    named = causes[0] if causes and abs(causes[0].sigmas) >= NAMED_SIGMAS else None
    if named is not None:
        told = f"Possible cause: {' or '.join(f'{one.words} (share {one.share:.2g})' for one in causes)}."
    else:
        told = "The velocity varies too little to say which." if causes else "No single beam explains it."
    sd = np.sqrt(np.diag(slope.cov))
    listed = ", ".join(f"{value:+.3f} ± {spread:.2g}" for value, spread in zip(slope.slope, sd, strict=True))
    return [
        Finding(
            "closure_depends_on_velocity" if named is None else ("mistilted_beam" if turned else "beam_scale"),
            "fault", float(min(np.linalg.norm(slope.slope) / np.sum(np.abs(null_space(rows)[:, 0])), 1.0)),
            f"The closure depends on the velocity: the beams differ from the matrix. {told}",
            f"Slope on x, y, z {listed} (p {slope.p_value:.1g}); {1e3 * effect:.0f} mm/s RMS of closure. Neighbours "
            f"{slope.lag} {'ping' if slope.lag == 1 else 'pings'} away serve as instrumental variable.",
            "Closure observes three numbers of the twelve, so that a single beam is assumed: check the named beam "
            "against the manufacturer's drawing, or calibrate with a reference.",
            size=float(np.rad2deg(size)) if turned else 100.0 * size,
            unit="deg" if turned else "%", beams=(named.beam + 1,) if named is not None else (),
        )
    ]  # fmt: skip


def _turned_words(one: Suspect) -> str:
    return (
        f"the direction of beam {one.beam + 1} off by {np.rad2deg(one.angle_rad):.1f} ± "
        f"{np.rad2deg(one.angle_sd_rad):.1g} deg ({np.rad2deg(one.tilt_change_rad):+.1f} deg of it tilt)"
    )


def _scaled_words(one: Suspect) -> str:
    return f"the scale of beam {one.beam + 1} off by {100.0 * one.scale:+.1f} ± {100.0 * one.scale_sd:.1g} %"
