"""Can this be trusted? One answer from the findings: yes, partly or no, with the numbers that decide it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import polars as pl

from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.against_reckoning import TRUSTED, VAGUE, Agreement, metres
from bottomlock.replay.findings.sway import Sway
from bottomlock.replay.findings.verdict import ABSORBED, WRONG, Innovations
from bottomlock.tables.replay import FORWARD

OF_FILTERS_ALONE = {
    "gyro_unit", "gyro_sign", "gyro_offset", "start_level", "start_velocity", "start_heading", "depth_sign",
    "depth_scale", "beam_noise", "other_dive",
}  # fmt: skip
"""Causes that dead reckoning does not have: no gyro, no start of the attitude, no weighting of beams."""

NOTHING = "Nothing."
FREE = "ins"
"""Free inertial navigation, the comparison without a DVL."""
PARTIAL = 0.1
"""Part of the pings with fewer than three beams from which an assumption on the sway helps."""


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
    """

    verdict: Literal["yes", "partly", "no"]
    sentence: str
    numbers: tuple[str, ...]
    change: str
    method: str
    vehicle: str

    def to_json(self) -> dict[str, Any]:
        """The answer in the types of JSON."""
        return asdict(self) | {"numbers": list(self.numbers)}


@dataclass(frozen=True, eq=False)
class Evidence:
    """What an answer is made of.

    Attributes:
        verdict: the first finding, and its state.
        causes: the likely causes, the likeliest first.
        further: findings after them.
        seen: innovations; None without a fix.
        closure: what beams left out show, in a sentence; "" without redundant beams.
        agreements: of the trusted methods with dead reckoning.
        reckoned: whether there is dead reckoning.
        aided: whether the recorded attitude aids the filters.
        reference: error of the method against the reference over its σ, in a sentence; "" without positions.
        sway: as measured.
        partial: part of the pings with fewer than three beams.
        methods: filters of the case.
        sd_m: claimed σ of the horizontal position at the end, of each method.
        way_m: distance travelled, by dead reckoning where there is one.
        geometry_open: whether the geometry of recorded beams is a guess.
    """

    verdict: Finding
    state: str
    causes: Sequence[Finding]
    further: Sequence[Finding]
    seen: Innovations | None
    closure: str
    agreements: Sequence[Agreement]
    reckoned: bool
    aided: bool
    reference: str
    sway: Sway | None
    partial: float
    methods: Sequence[str]
    sd_m: Mapping[str, float]
    way_m: float
    geometry_open: bool

    @property
    def judged(self) -> Agreement | None:
        """Agreement of the method to take, or else of the one that stands for all; None without dead reckoning."""
        taken = recommended(self)
        return next(
            (one for one in self.agreements if one.method == taken), next(iter(self.agreements), None)
        )

    @property
    def sd_taken_m(self) -> float:
        """Claimed σ at the end of that method; 0 where there is none."""
        name = recommended(self) if self.judged is None else self.judged.method
        return self.sd_m.get(name, 0.0)


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
        lambda evidence: evidence.geometry_open and not evidence.reference,
        lambda _: "The geometry of the beams is an open question, and dead reckoning has the same.",
        "Set dvl.geometry to that of the instrument and geometry_known = true, or give positions as [reference].",
    ),
    Rule(
        lambda evidence: not evidence.reckoned and not evidence.reference,
        lambda _: "The beams fit the navigation, and nothing else confirms it.",
        "Give an [attitude] for dead reckoning, or positions as [reference].",
    ),
)
"""Reasons for "partly" beside the findings, the gravest first."""


def answer_of(evidence: Evidence) -> Answer:
    """The answer that the evidence leads to."""
    cause = next(iter(evidence.causes), None)
    faulty = cause is not None and cause.severity == "fault"
    vehicle = "" if evidence.sway is None else evidence.sway.words()
    numbers = tuple(one for one in (_innovations(evidence), _agreement(evidence)) if one)
    if evidence.state == WRONG or faulty or _refuted(evidence):
        first = cause or evidence.verdict
        reckons = evidence.reckoned and (cause is None or cause.kind in OF_FILTERS_ALONE)
        return Answer("no", first.text, numbers, first.hint, METHOD if reckons else "", vehicle)
    method = recommended(evidence)
    doubts = [one for one in (*evidence.causes, *evidence.further) if one.severity != "note"]
    if evidence.verdict.severity != "note" and evidence.state != ABSORBED:
        doubts = [evidence.verdict, *doubts]
    reasons = [(one.text, one.hint) for one in doubts]
    reasons += [(rule.sentence(evidence), rule.change) for rule in RULES if rule.applies(evidence)]
    for sentence, change in reasons[:1]:
        return Answer("partly", sentence, numbers, change, method, vehicle)
    agree = [
        name
        for name, there in (
            ("dead reckoning", evidence.reckoned),
            ("the reference", bool(evidence.reference)),
        )
        if there
    ]
    return Answer(
        "yes", f"The beams fit the navigation, and {' and '.join(agree)} {'agree' if len(agree) > 1 else 'agrees'}.",
        numbers, _improvement(evidence), method, vehicle,
    )  # fmt: skip


def _improvement(evidence: Evidence) -> str:
    """What would be better in a replay that can be trusted."""
    unused = evidence.reckoned and not evidence.aided
    if unused and evidence.agreements and evidence.agreements[0].beaten:
        return (
            'Set attitude.aids = "heading" or "attitude": dead reckoning with it is nearer to the reference.'
        )
    return NOTHING


def _refuted(evidence: Evidence) -> bool:
    """Whether the reference contradicts the method's claim, and dead reckoning less."""
    worse = bool(evidence.agreements) and evidence.agreements[0].worse
    return worse and any(one.kind == "claims" for one in evidence.further)


def recommended(evidence: Evidence) -> str:
    """The filter that fits vehicle and beams, of those that stay with dead reckoning.

    An assumption on the sway is worth its risk where pings lack beams, and where complete ones do not contradict it.
    What the reference shows to be worse than dead reckoning comes last. The free inertial navigation is none of them.
    """
    astray = {FREE} | {
        one.method for one in evidence.agreements if one.leaves or one.lost or one.worse or one.vague
    }
    beaten = {one.method for one in evidence.agreements if one.beaten}
    slender = evidence.sway is not None and evidence.sway.fits and evidence.partial > PARTIAL
    order = ("sway_current", *TRUSTED) if slender else TRUSTED
    usable = [one for one in (*order, *evidence.methods) if one in evidence.methods and one not in astray]
    usable.sort(key=lambda one: one in beaten)
    return usable[0] if usable else METHOD if evidence.reckoned else ""


def _innovations(evidence: Evidence) -> str:
    parts = [] if evidence.seen is None else [evidence.seen.words()]
    return " ".join([*parts, *([evidence.closure] if evidence.closure else [])])


def _agreement(evidence: Evidence) -> str:
    parts = [one.words() for one in evidence.agreements[:1]]
    return " ".join([*parts, *([evidence.reference] if evidence.reference else [])])


def reference_words(samples: pl.DataFrame, method: str) -> str:
    """Error of a method's position against the reference over its σ; "" without positions.

    Args:
        samples: `tables.replay.REPLAY_SAMPLES` of the recording.
        method: whose.
    """
    rows = samples.filter((pl.col("pass") == FORWARD) & (pl.col("method") == method)).slice(1)
    axes = ("north", "east")
    known = rows.filter(pl.all_horizontal(pl.col(f"err_position_{axis}_m").is_not_null() for axis in axes))
    if known.is_empty():
        return ""
    squares = [((pl.col(f"err_position_{a}_m") / pl.col(f"sd_position_{a}_m")) ** 2).mean() for a in axes]
    ratio = float(known.select((sum(squares[1:], squares[0]) / len(axes)).sqrt()).item())
    last = known.row(-1, named=True)
    end = (last["err_position_north_m"] ** 2 + last["err_position_east_m"] ** 2) ** 0.5
    return f"Reference: {method} is {end:.3g} m off at the end, error over claimed σ {ratio:.2g} RMS, horizontally."
