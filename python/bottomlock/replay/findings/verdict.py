"""Can this be trusted? Yes, partly or no, by the first of the rules that applies to the evidence.

A mistake is a "no" where it may have moved the track, and a doubt where dead reckoning or a reference shows that it has
not. What speaks against a track is a "no" or a doubt by itself; "yes" is what no rule keeps from it.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, Literal

from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.limits import (
    HIGH_RATIO,
    MANY_REJECTED,
    NEAR_SIGMAS,
    PARTIAL,
    REFERENCE_SIGMAS,
    VAGUE,
    WRONG_RATIO,
    WRONG_REJECTED,
)
from bottomlock.replay.findings.tracks import metres
from bottomlock.replay.findings.trust import Evidence, recommended

OF_FILTERS_ALONE = {
    "no_fix", "gyro_unit", "gyro_offset", "start_level", "start_velocity", "start_heading", "depth_sign", "depth_scale",
    "beam_noise", "other_dive",
}  # fmt: skip
"""Causes that dead reckoning does not have: no gyro, no start of the attitude, no weighting of beams. A gyro's
sign is none of them: by the gyros `replay --init` finds frames and clock of the attitude."""

UNSHOWN = {"no_fix", "depth_sign", "depth_scale", "gyro_sign"}
"""Causes that agreement with dead reckoning does not clear: no depth shows in a horizontal track, clock and frames of
the attitude were told by those gyros, and without a fix nothing was tested."""
NOTHING = "Nothing."


@dataclass(frozen=True)
class Answer:
    """Whether a replay can be trusted.

    Attributes:
        verdict: "yes", "partly" or "no".
        sentence: why, in one sentence; a cause comes first.
        numbers: what decides it: innovations with beams left out, then dead reckoning and the reference.
        change: what to change.
        method: whose track to take; "" where none of them is right until the change is made.
        vehicle: which method fits the sway of this vehicle; "" where it was not measured.
        assumed: open entries: keys of the case that nothing decides.
    """

    verdict: Literal["yes", "partly", "no"]
    sentence: str
    numbers: tuple[str, ...]
    change: str
    method: str
    vehicle: str
    assumed: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The answer in the types of JSON."""
        return asdict(self) | {"numbers": list(self.numbers), "assumed": list(self.assumed)}


def answer_of(evidence: Evidence) -> Answer:
    """The answer that the evidence leads to."""
    cause, reference, reckoned = next(iter(evidence.causes), None), evidence.reference, evidence.reckoned
    beams = ("" if evidence.seen is None else evidence.seen.words(), evidence.closure)
    position = (
        *(one.words() for one in evidence.agreements[:1]),
        "" if reference is None else reference.words(),
    )
    numbers = tuple(filter(None, (" ".join(filter(None, words)) for words in (beams, position))))
    further = "" if evidence.sway is None else evidence.sway.words(), evidence.assumed
    for sentence, change in _wrong(evidence):
        reckons = reckoned and (cause is None or cause.kind in OF_FILTERS_ALONE)
        reckons &= not any(one.reckoned_refuted for one in evidence.agreements)
        # What is wrong is told by its cause.
        first = (sentence, change) if cause is None else (cause.text, cause.hint)
        return Answer("no", first[0], numbers, first[1], METHOD if reckons else "", *further)
    method = recommended(evidence)
    for sentence, change in _doubts(evidence):
        return Answer("partly", sentence, numbers, change, method, *further)
    agree = ["dead reckoning"] * reckoned + ["the reference"] * (reference is not None)
    confirmed = f"{' and '.join(agree)} {'agree' if len(agree) > 1 else 'agrees'}"
    change = NOTHING
    if reckoned and not evidence.aided and evidence.agreements and evidence.agreements[0].beaten:
        change = (
            'Set attitude.aids = "heading" or "attitude": dead reckoning with it is nearer to the reference.'
        )
    return Answer("yes", f"The beams fit the navigation, and {confirmed}.", numbers, change, method, *further)


NO_CAUSE = "No single cause stands out: check units, start, mounting, axes and clock."


def _wrong(evidence: Evidence) -> Iterator[tuple[str, str]]:
    """Why an answer is "no", and what to change."""
    seen, cause = evidence.seen, next(iter(evidence.causes), None)
    own = next((one for one in evidence.agreements if seen is not None and one.method == seen.method), None)
    if own is not None and own.departs:
        yield (
            own.departure(),
            NO_CAUSE if own.reckoned_refuted else f"{NO_CAUSE} Until then take dead_reckoning.",
        )
    if seen is not None and (seen.rejected > WRONG_REJECTED or seen.ratio > WRONG_RATIO):
        yield (
            "Something is wrong: the beams do not fit the navigation.",
            f"{NO_CAUSE} Are IMU and DVL of the same dive? `bottomlock audit` tests the log.",
        )
    faulty = cause is not None and cause.severity == "fault"
    if cause is not None and faulty and (cause.kind in UNSHOWN or not _confirmed(evidence, cause)):
        yield cause.text, cause.hint
    if evidence.agreements and evidence.agreements[0].worse:
        yield from ((one.text, one.hint) for one in evidence.further if one.kind == "claims")


def _doubts(evidence: Evidence) -> Iterator[tuple[str, str]]:
    """Why an answer is "partly" at most, and what to change: what was found, then rules, the gravest first."""
    judged, reference, seen, doubted = evidence.judged, evidence.reference, evidence.seen, evidence.doubted
    # What names no mistake says less than positions that agree.
    settled = "unexplained" if reference is not None and _confirmed(evidence) else ""
    for one in (*evidence.causes, *evidence.further):
        if one.severity != "note" and one.kind != settled:
            yield one.text, one.hint
    if seen is not None and (seen.rejected > MANY_REJECTED or seen.ratio > HIGH_RATIO):
        yield (
            "The filter claims more than the beams confirm.",
            "Larger dvl.beam_noise_mps or imu.errors would make it consistent.",
        )
    if judged is not None and judged.worse:
        yield (
            "Dead reckoning is nearer to the reference by more than the claims of both and its noise explain.",
            "Take dead_reckoning; imu.errors and dvl.beam_noise_mps claim less than the filter's error.",
        )
    if judged is not None and judged.confirmed_alone:
        yield (
            f"The reference confirms {judged.method} and not dead reckoning, which is {metres(judged.apart_m)} away.",
            "Look at [attitude]: a compass that stands still, or whose clock or frame changes.",
        )
    if reference is not None and not reference.agrees:
        yield (
            f"The reference does not confirm the track: {reference.words()}",
            "Check reference.clock and heading; where reference.sd_m is too small, state it.",
        )
    if doubted is not None:
        yield doubted.words(), "Look at this sensor's noise, unit and axes in the case, or leave it out."
    claim = f"The method claims 1 sigma of {metres(evidence.sd_taken_m)} at the end, more than"
    if judged is not None and judged.vague:
        yield (
            f"{claim} {VAGUE:g} times that of dead reckoning.",
            'Take dead_reckoning; imu.errors may be too large, or attitude.aids = "attitude" bounds them.',
        )
    if evidence.sd_taken_m > evidence.way_m:
        yield (
            f"{claim} the {metres(evidence.way_m)} travelled.",
            "Check imu.errors and the start; an [attitude] that aids bounds the error.",
        )
    if reference is None:
        yield from _open(evidence)
    if not evidence.reckoned and (reference is None or not reference.near(evidence.way_m)):
        few = f", {100.0 * evidence.partial:.0f} % of the pings have fewer than three,"
        yield (
            f"The beams fit the navigation{few * (evidence.partial > PARTIAL)} and nothing else confirms it.",
            "Give an [attitude] for dead reckoning by pings of three beams, or positions as [gps].",
        )


OPEN = {
    "dvl.geometry": ("The geometry of the beams is", "Set dvl.geometry to that of the instrument"),
    "dvl.mounting": ("The mounting of the DVL is", "Set it in the geometry file"),
    "attitude.yaw_offset_deg": (
        "Whether the recorded heading is magnetic or true is", "Set attitude.yaw_offset_deg (0 for a true yaw)",
    ),
    "dvl.velocity_unit": ("The unit of the velocity is", "Set dvl.velocity_unit"),
}  # fmt: skip
"""What moves dead reckoning as it moves the filter, by how its keys begin: the question, and what to change."""


def _open(evidence: Evidence) -> Iterator[tuple[str, str]]:
    """What nothing decides without a reference."""
    for key, (question, change) in OPEN.items():
        # No geometry moves a velocity that beams are projected from.
        asked = key != "dvl.geometry" or not evidence.projected
        if asked and any(one.startswith(key) for one in evidence.assumed):
            yield (
                f"{question} an open question, and dead reckoning has the same.",
                f"{change} and take it out of assumed, or give positions as [reference].",
            )


def _confirmed(evidence: Evidence, cause: Finding | None = None) -> bool:
    """Whether dead reckoning has the same track, and the reference, if there is one, does not contradict it.

    Without one, what turns or scales both tracks alike is not beyond their claim.
    """
    if evidence.judged is None or evidence.judged.sigmas > NEAR_SIGMAS:
        return False
    if evidence.reference is not None:
        return evidence.reference.agrees
    sd_m = evidence.sd_m.get(recommended(evidence), 0.0)
    return cause is None or cause.size * evidence.reach_m <= REFERENCE_SIGMAS * sd_m
