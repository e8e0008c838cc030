"""What an audit may find: its limits, one template a kind, and the findings as a table."""

import math
import string
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bottomlock.recordings.finding import Finding, Severity, beam_words

SIGNIFICANCE = 1e-5
"""False-alarm probability of each test. An audit makes fewer than 50: 1 clean log in 2000 gets a false finding."""

MATERIAL_RAD, MATERIAL_SCALE, MATERIAL_MPS = np.deg2rad(0.5), 0.005, 0.002
"""Smaller errors are not reported, however significant: 0.5° of tilt is 2 % of surge at 25°; 0.5 % of scale; 2 mm/s."""

LOCK_ADVICE = "Record in the water, with the bottom within the instrument's range."
FROM_FILE = "Use the geometry file that this audit writes, or correct the column map."
CLOSES = (
    "Robust closure of a unit combination {order.plain_mps:mm .1f} mm/s as stated ({order.scatter_mps:mm .1f} about "
    "its median), {order.best_mps:mm .1f} mm/s after the change."
)
BY_REFERENCE = (
    "From velocity and attitude beside the log, {of.instants} instants; residual {of.residual_mps:mm .0f} mm/s; "
    "{of.explained:% .0f} % of the motion explained; rates {of.rate_rms_radps:deg .2g} deg/s RMS."
)
ANGLES = "Tilts {of.tilt_rad:deg .2f} deg, azimuths {of.azimuth_rad:deg .1f} deg from {of.pings} pings."


@dataclass(frozen=True)
class Kind:
    """How the findings of a kind are told: templates of `str.format` over the numbers of each.

    Attributes:
        severity: of most; a check may state another.
        unit: of the size.
        text, evidence, hint, expected: as `Finding` has them.
    """

    severity: Severity
    unit: str
    text: str
    evidence: str
    hint: str
    expected: str = ""


_TIME = Kind(
    "fault", "pings", "{size:.0f} of {log.pings} pings {what}.", "First in row {row}: {after} ns after {before} ns.",
    "Use the instrument's time of validity instead of the host's, or drop these rows before `bottomlock fix`.",
    "rising times",
)  # fmt: skip
_READER = Kind(
    "note", "records", "{size:.0f} of {read:.0f} records of the recording {what}: {name}.", "First: {first}.",
    "See the account (JSON) beside the table.",
)  # fmt: skip
_ORDER = Kind(
    "fault", "times", "The beams do not close as stated, and close {size:.1f} times better with {order.words}.", CLOSES,
    "{advice}",
)  # fmt: skip
_THIS_IS = Kind("note", "geometries", "This is {fits}.", "{basis}", "Audit and solve with --geometry {fits}.")
_PART = Kind(
    "warning", "", "The {part.what} of the DVL is {values} {part.unit}, stated is {stated:.2f}.", BY_REFERENCE,
    "Set it for the DVL, or let the filter estimate it.", "{stated:.2f} {part.unit}",
)  # fmt: skip
KINDS = {
    "never_locked": Kind(
        "warning", "pings", "The instrument never had bottom lock in this log: {why}.",
        "{flagged} pings have all beams flagged valid. Beams, closure and mounting are not judged.", LOCK_ADVICE,
    ),
    "reader_skipped": _READER,
    "reader_flagged": _READER,
    "time_repeats": _TIME,
    "time_goes_back": _TIME,
    "time_gaps": Kind(
        "note", "gaps", "Gaps in time: {size:.0f}, together {missing:.3g} s of {span:.4g} s.",
        "The median step is {usual:.4g} s; the longest is {longest:.4g} s, before row {row}.",
        "None if the instrument did not ping: the filter propagates without it. Else look for lost lines.",
    ),
    "stale_pings": Kind(
        "warning", "pings", "{size:.0f} pings ({percent} %) repeat the whole ping before them unchanged.",
        "{chance:.2g} are expected by chance; first in row {row}, longest run {longest} pings.",
        "Drop them: a repeated reading is an old velocity, and is not independent of the ping before.",
        "new readings",
    ),
    "stuck_beam": Kind(
        "fault", "pings", "{Beams} is stuck at {value:.3f} m/s for {size:.0f} pings, {percent} % of its own.",
        "First in row {row}, {time_s:.1f} s; by chance the longest run is {longest:.0f} readings.",
        "Flag it invalid there: a reading that does not change is none.",
    ),
    "zero_as_valid": Kind(
        "fault", "pings",
        "{Beams} is flagged valid with a velocity of exactly zero in {size:.0f} pings ({percent} %).",
        "{usual:.2g} are expected at a resolution of {quantum:.2g} m/s; first in row {row}.",
        "Treat zero as a lost beam: clear the flag where the velocity is exactly zero.", "a cleared flag",
    ),
    "too_fast": Kind(
        "fault", "m/s", "The beams read {size:.3g} m/s in the median, which no vehicle's are.",
        "Of {readings} readings that are flagged valid.",
        "Check the unit: `velocity_scale` of a column map (0.001 for mm/s) turns it into m/s.",
        "at most {most:g} m/s",
    ),
    "rejected_by_instrument": Kind(
        "note", "pings",
        "The instrument flags its velocity invalid in {size:.0f} pings with all {of} beams valid ({percent} %).",
        "First in row {row}.", "Flags of the beams are not sufficient: gate by closure and by innovation as well.",
    ),
    "velocity_without_beams": Kind(
        "fault", "pings",
        "The instrument flags its velocity valid in {size:.0f} pings with fewer than three valid beams.",
        "First in row {row}.", "Do not use that velocity: it depends on data that are not in the log.",
    ),
    "noisy_beam": Kind(
        "warning", "times",
        "{Beams} is {size:.1f} times noisier than the others: {own:mm .1f} mm/s against {others:mm .1f} mm/s.",
        "Third differences of {pings} pings predict a closure of {predicted:mm .1f} mm/s; it is {closure:mm .1f}.",
        "Give it its own noise (beam_noise_mps of each beam) or leave it out, and look at the transducer.",
        "{others:mm .1f} mm/s",
    ),
    "identical_beams": Kind(
        "fault", "of pings", "{Beams} hold the same numbers{reverse} in {percent} % of {pings} pings.",
        "Two transducers do not agree to the last digit.",
        "Look for a column that is read twice; until then use one of the two and treat the other as lost.",
    ),
    "too_few_pings": Kind(
        "note", "pings", "{what} not observable in this log.",
        "Only {size:.0f} pings have all beams{and_what}; at least {least} are needed.",
        "Record longer with bottom lock on all beams.",
    ),
    "directions_not_observable": Kind(
        "note", "deg",
        "Beam directions are not observable in this log: the velocity varies too little, or its pings are too few or "
        "too correlated.",
        "Standard deviations {of.direction_sd_rad:deg .2g} deg from {of.blocks} independent blocks, of which {least} "
        "are needed; the velocity varies by {spread:.2g} m/s in x, y, z.",
        "Record longer, with surge, sway and heave of a few decimetres per second.",
    ),
    "beams_alone": Kind(
        "note", "",
        "Neither order nor directions of the beams are observable without the instrument's velocity or a stated "
        "geometry.",
        "No packaged geometry closes clearly better than the others. Closure leaves 9 of the 12 entries of four beams "
        "free (a rotation, mirroring or stretch of the whole closes equally well), and all of three.",
        "State a geometry, and record surge, sway and heave well above the noise.",
    ),
    "packaged_geometries": _THIS_IS,
    "another_geometry": replace(_THIS_IS, severity="fault", text="This is {fits}, not {stated}."),
    "packaged_geometries/several": Kind(
        "note", "geometries", "The beams fit the packaged geometries {fits}.", "{basis}",
        "State that of your instrument with --geometry; closure alone shows neither tilt nor yaw.",
    ),
    "swapped_beams/closure": _ORDER,
    "sign_flipped/closure": _ORDER,
    "order_or_bias": Kind(
        "fault", "times", "Either the order is not the stated one ({order.words}), or the closure has a bias.",
        CLOSES + " The vehicle's velocity varies too little to decide.",
        "Record the vehicle on two courses, or the instrument's own velocity.",
    ),
    "swapped_beams": Kind("fault", "beams", "The order is not the stated one: {pairs}.", ANGLES, FROM_FILE),
    "sign_flipped": Kind("fault", "beams", "Opposite sign: {beams}.", ANGLES, FROM_FILE),
    "all_signs_flipped": Kind(
        "fault", "beams", "Every beam has the opposite sign: z or the readings are positive upwards.", ANGLES,
        FROM_FILE + " A recorded depth gives the direction of z.",
    ),
    "rotated_geometry": Kind(
        "fault", "deg",
        "The beams match the stated ones only after a common rotation: roll, pitch, yaw {rpy:deg .1f} deg.", ANGLES,
        "State the mounting, or rotate the instrument's velocity to the stated frame.",
    ),
    "mistilted_beam": Kind(
        "fault", "deg",
        "In the matrix that the instrument uses, off the stated direction by up to {size:.2f} deg: {beams}.",
        ANGLES + " Off by {off} deg, stated tilts {stated:deg .2f}. With four beams a channel changed after "
        "the instrument solved shows in every beam.",
        "Compare with the manufacturer's drawing; correct the stated geometry, or the channel.",
    ),
    "scale": Kind(
        "warning", "%",
        "The scale of {beams} differs from that of the instrument's velocity by up to {signed:% +.2f} %.",
        "Scales {scales}.", "If common, only one of the two is corrected for the speed of sound; else a beam's fault.",
        "the scale of the velocity",
    ),
    "beam_bias": Kind(
        "warning", "mm/s",
        "{Beams} has a bias of {size:+.1f} mm/s against the instrument's velocity and the other beams.",
        "± {sd:.1g} mm/s. The part that the instrument has included in its velocity is not observable.",
        "Subtract it, or let the filter estimate beam biases.", "0 mm/s",
    ),
    "closure_depends_on_velocity": Kind(
        "fault", "mm/s",
        "The closure depends on the velocity, by {size:.0f} mm/s RMS: directions or scales differ from the matrix.",
        "Slope on x, y, z {slope} (p {of.p_value:.1g}). The pings {of.lag} away serve as instrumental variable.",
        "Closure names no beam: check the beams against the manufacturer's drawing, or calibrate with a reference.",
    ),
    "closure_bias": Kind(
        "warning", "mm/s",
        "The median closure is {size:+.1f} mm/s: at least one beam has a bias, or a scale or direction that a steady "
        "course shows as one.",
        "± {sd:.1g} mm/s over {of.pings} pings. The three combinations of biases that act like a velocity do not show.",
        "Let the filter estimate beam biases; compare at rest on the bottom.", "0 mm/s",
    ),
    "heavy_tails": Kind(
        "warning", "of pings",
        "The closure has heavy tails: {percent} % of {of.pings} pings lie beyond three robust sigmas, 0.27 % would if "
        "the noise were Gaussian.",
        "Median |e| {of.median_abs_mps:mm .1f}, robust sigma {of.sigma_mps:mm .1f}, 95 % {of.p95_mps:mm .0f}, "
        "99 % {of.p99_mps:mm .0f}, largest {of.max_mps:mm .0f} mm/s.",
        "Gate single beams, or use the heavy-tailed update; state the robust sigma as beam noise, not the RMS.",
        "0.27 % beyond three sigmas",
    ),
    "mounting_not_observable": Kind(
        "note", "",
        "Misalignment, lever arm, clock offset and scale are not observable in this log: the other recordings do not "
        "explain the velocity.",
        BY_REFERENCE, "Record accelerations, rotations and speeds well above the noise of the instrument.",
    ),
    "not_observable": Kind(
        "note", "", "The {part.what} is not observable in this log{names}.",
        "Standard deviations {sds:.2g} {part.unit}; infinite with too few independent pings, or too little of "
        "this motion.",
        "Record more {part.lacks}.",
    ),
    "left_handed": Kind(
        "fault", "", "The instrument's velocity is in a left-handed frame: it fits with its y axis reversed.",
        BY_REFERENCE, "Reverse y before using the velocity.",
    ),
    "misalignment": replace(_PART, unit="deg"),
    "lever_arm": replace(_PART, unit="m"),
    "clock_offset": replace(_PART, unit="s"),
    "velocity_scale": replace(_PART, unit="%"),
    "another_time": Kind(
        "fault", "s", "No reading of the reference lies within the times of the log: it was compared with nothing.",
        "The log is of {log} ns, the reference of {other} ns: it begins {size:+.3f} s after the log.",
        "Bring both to one clock: an instrument may count from its start, where another one has the time of day.",
        "times of {log} ns",
    ),
}  # fmt: skip
"""By the kind, and where one has several templates by the kind and the case."""


FACTORS = {"mm": 1e3, "deg": np.rad2deg(1.0), "%": 100.0}
"""From SI to the unit that begins a format, with a space: `{sigma_mps:mm .1f}`."""


Told = dict[str, Any]
"""What a template names, by its name there."""


class _Templates(string.Formatter):
    """Numbers in the unit of their format; arrays as one number after the other."""

    def format_field(self, value: Any, format_spec: str) -> str:  # noqa: ANN401 - what a template names
        unit, _, form = format_spec.rpartition(" ")
        if unit:
            value = FACTORS[unit] * value
        return (
            ", ".join(format(one, form) for one in value)
            if isinstance(value, np.ndarray)
            else format(value, form)
        )


def finding(
    template: str,
    size: float = 1.0,
    weight: float = 1.0,
    *,
    beams: Iterable[int] = (),
    sd: float = math.nan,
    severity: Severity | None = None,
    **told: Any,  # noqa: ANN401 - what a template names
) -> Finding:
    """A finding told by its template.

    Args:
        template: of `KINDS`.
        size, weight, sd, severity: of the finding; the severity is the kind's by default.
        beams: concerned, from 0.
        told: what the template names beside size, sd, beams and percent (of the weight).
    """
    kind, numbers, words = KINDS[template], tuple(int(beam) + 1 for beam in beams), beam_words(beams)
    told |= {
        "size": size,
        "sd": sd,
        "percent": f"{100.0 * weight:.3g}",
        "beams": words,
        "Beams": words.capitalize(),
    }
    text, evidence, hint, expected = (
        _Templates().vformat(one, (), told) for one in (kind.text, kind.evidence, kind.hint, kind.expected)
    )
    return Finding(
        template.partition("/")[0], severity or kind.severity, float(weight), text, evidence, hint,
        expected=expected, size=float(size), sd=float(sd), unit=kind.unit, beams=numbers,
    )  # fmt: skip


def with_sd(values: Iterable[float], sds: Iterable[float], form: str = ".2f", of_sd: str = ".2g") -> str:
    """Numbers one after the other, each with its 1 sigma.

    >>> with_sd([1.0, -2.5], [0.1, 0.25], "+.1f")
    '+1.0 ± 0.1, -2.5 ± 0.25'
    """
    return ", ".join(f"{one:{form}} ± {sd:{of_sd}}" for one, sd in zip(values, sds, strict=True))
