"""Can this be trusted? One answer from the findings: yes, partly or no, with the numbers that decide it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, Literal

from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.against_reckoning import metres
from bottomlock.replay.findings.evidence import Evidence, recommended
from bottomlock.replay.findings.limits import NEAR_SIGMAS, REFERENCE_SIGMAS, VAGUE
from bottomlock.replay.findings.verdict import ABSORBED, WRONG

OF_FILTERS_ALONE = {
    "gyro_unit", "gyro_sign", "gyro_offset", "start_level", "start_velocity", "start_heading", "depth_sign",
    "depth_scale", "beam_noise", "other_dive",
}  # fmt: skip
"""Causes that dead reckoning does not have: no gyro, no start of the attitude, no weighting of beams."""

OF_DEPTH = {"depth_sign", "depth_scale"}
"""Causes that a horizontal track does not show."""
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


@dataclass(frozen=True)
class Rule:
    """A reason for which an answer is "partly" at most.

    Attributes:
        applies: whether the evidence has it.
        sentence: why, in one sentence.
        change: what to change.
    """

    applies: Callable[[Evidence], bool]
    sentence: Callable[[Evidence], str]
    change: str


def _worse(evidence: Evidence) -> bool:
    return evidence.judged is not None and evidence.judged.worse


def _vague(evidence: Evidence) -> bool:
    return evidence.judged is not None and evidence.judged.vague


RULES = (
    Rule(
        _worse,
        lambda _: (
            "Dead reckoning is nearer to the reference by more than the claims of both and its noise explain."
        ),
        "Take dead_reckoning; imu.errors and dvl.beam_noise_mps claim less than the filter's error.",
    ),
    Rule(
        lambda evidence: evidence.reference is not None and not evidence.reference.agrees,
        lambda evidence: (
            f"The reference does not confirm the track: {evidence.reference.words()}"
            if evidence.reference
            else ""
        ),
        "Check reference.clock and heading; where reference.sd_m is too small, state it.",
    ),
    Rule(
        lambda evidence: evidence.doubted is not None,
        lambda evidence: evidence.doubted.words() if evidence.doubted else "",
        "Look at this sensor's noise, unit and axes in the case, or leave it out.",
    ),
    Rule(
        _vague,
        lambda evidence: (
            f"The method claims 1 sigma of {metres(evidence.sd_taken_m)} at the end, more than {VAGUE:g} "
            "times that of dead reckoning."
        ),
        'Take dead_reckoning; imu.errors may be too large, or attitude.aids = "attitude" bounds them.',
    ),
    Rule(
        lambda evidence: evidence.sd_taken_m > evidence.way_m,
        lambda evidence: (
            f"The method claims 1 sigma of {metres(evidence.sd_taken_m)} at the end, more than the "
            f"{metres(evidence.way_m)} travelled."
        ),
        "Check imu.errors and the start; an [attitude] that aids bounds the error.",
    ),
    Rule(
        lambda evidence: evidence.geometry_open and evidence.reference is None,
        lambda _: "The geometry of the beams is an open question, and dead reckoning has the same.",
        "Set dvl.geometry to that of the instrument and take it out of assumed, or give positions as [reference].",
    ),
    Rule(
        lambda evidence: evidence.heading_open and evidence.reference is None,
        lambda _: (
            "Whether the recorded heading is magnetic or true is an open question, and dead reckoning has the same."
        ),
        "Set attitude.yaw_offset_deg (0 for a true yaw) and take it out of assumed, or give positions as [reference].",
    ),
    Rule(
        lambda evidence: not evidence.reckoned and evidence.reference is None,
        lambda _: "The beams fit the navigation, and nothing else confirms it.",
        "Give an [attitude] for dead reckoning, or positions as [reference].",
    ),
)
"""Reasons for "partly" beside the findings, the gravest first."""


def answer_of(evidence: Evidence) -> Answer:
    """The answer that the evidence leads to."""
    cause = next(iter(evidence.causes), None)
    faulty = (
        cause is not None
        and cause.severity == "fault"
        and (cause.kind in OF_DEPTH or not _confirmed(evidence, cause))
    )
    further = "" if evidence.sway is None else evidence.sway.words(), evidence.assumed
    numbers = tuple(one for one in (_innovations(evidence), _agreement(evidence)) if one)
    if evidence.state == WRONG or faulty or _refuted(evidence):
        first = cause or evidence.verdict
        reckons = evidence.reckoned and (cause is None or cause.kind in OF_FILTERS_ALONE)
        return Answer("no", first.text, numbers, first.hint, METHOD if reckons else "", *further)
    method = recommended(evidence)
    doubts = [one for one in (*evidence.causes, *evidence.further) if one.severity != "note"]
    if evidence.reference is not None and _confirmed(evidence):
        # What names no mistake says less than positions that agree.
        doubts = [one for one in doubts if one.kind != "unexplained"]
    if evidence.verdict.severity != "note" and evidence.state != ABSORBED:
        doubts = [evidence.verdict, *doubts]
    reasons = [(one.text, one.hint) for one in doubts]
    reasons += [(rule.sentence(evidence), rule.change) for rule in RULES if rule.applies(evidence)]
    for sentence, change in reasons[:1]:
        return Answer("partly", sentence, numbers, change, method, *further)
    agree = [
        name
        for name, there in (
            ("dead reckoning", evidence.reckoned),
            ("the reference", evidence.reference is not None),
        )
        if there
    ]
    return Answer(
        "yes", f"The beams fit the navigation, and {' and '.join(agree)} {'agree' if len(agree) > 1 else 'agrees'}.",
        numbers, _improvement(evidence), method, *further,
    )  # fmt: skip


def _improvement(evidence: Evidence) -> str:
    """What would be better in a replay that can be trusted."""
    unused = evidence.reckoned and not evidence.aided
    if unused and evidence.agreements and evidence.agreements[0].beaten:
        return (
            'Set attitude.aids = "heading" or "attitude": dead reckoning with it is nearer to the reference.'
        )
    return NOTHING


def _confirmed(evidence: Evidence, cause: Finding | None = None) -> bool:
    """Whether dead reckoning has the same track, and the reference, if there is one, does not contradict it.

    Without one, what turns or scales both tracks alike is not beyond their claim.
    """
    if evidence.judged is None or evidence.judged.sigmas > NEAR_SIGMAS:
        return False
    if evidence.reference is not None:
        return evidence.reference.agrees
    return cause is None or cause.size * evidence.reach_m <= REFERENCE_SIGMAS * evidence.sd_taken_m


def _refuted(evidence: Evidence) -> bool:
    """Whether the reference contradicts the method's claim, and dead reckoning less."""
    worse = bool(evidence.agreements) and evidence.agreements[0].worse
    return worse and any(one.kind == "claims" for one in evidence.further)


def _innovations(evidence: Evidence) -> str:
    parts = [] if evidence.seen is None else [evidence.seen.words()]
    return " ".join([*parts, *([evidence.closure] if evidence.closure else [])])


def _agreement(evidence: Evidence) -> str:
    parts = [one.words() for one in evidence.agreements[:1]]
    return " ".join([*parts, *([] if evidence.reference is None else [evidence.reference.words()])])
