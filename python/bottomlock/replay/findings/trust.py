"""Can this be trusted? One answer, yes, partly or no, from the findings, the tracks and a row a sensor.

Tracks are held against each other and a reference; the answer has the numbers that decide it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import polars as pl

from bottomlock.files.replay_tables import FORWARD
from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.limits import (
    AXES,
    FEWEST_READINGS,
    NEAR_SIGMAS,
    OF_WAY,
    PARTIAL,
    REFERENCE_RMS_SIGMAS,
    REFERENCE_SIGMAS,
    REJECTED,
    SLOW_SIGMAS,
    UNUSED,
    VAGUE,
)
from bottomlock.replay.findings.sensors import ASSUMED, SensorRow
from bottomlock.replay.findings.sway import Sway
from bottomlock.replay.findings.tracks import TRUSTED, Agreement, metres
from bottomlock.replay.findings.verdict import ABSORBED, WRONG, Innovations

FREE = "ins"
"""Free inertial navigation, the comparison without a DVL."""


@dataclass(frozen=True)
class Reference:
    """A method's horizontal position against the reference.

    Attributes:
        method: whose.
        end_m: distance at the end.
        end_sigmas: the same over the root of the sum of the squares of both σ.
        rms_sigmas: RMS of the error over the same of an axis, over time.
        rms_m: RMS of the error.
        sd_m: noise of the reference, root of the sum over both axes.
        until: part of the time of the track up to its last position.
    """

    method: str
    end_m: float
    end_sigmas: float
    rms_sigmas: float
    rms_m: float = 0.0
    sd_m: float = 0.0
    until: float = 1.0

    @property
    def confirms(self) -> bool:
        """Whether it agrees up to the end: positions before a dive say nothing of what follows."""
        return self.agrees and self.until > 1.0 - UNUSED

    @property
    def agrees(self) -> bool:
        """Whether the claims of both explain the distance."""
        return self.end_sigmas <= REFERENCE_SIGMAS and self.rms_sigmas <= REFERENCE_RMS_SIGMAS

    def near(self, way_m: float) -> bool:
        """Whether the error is small of the distance travelled, and not explained by a large claim alone."""
        return self.rms_m <= math.hypot(OF_WAY * way_m, self.sd_m)

    def words(self) -> str:
        """The comparison in one sentence."""
        return (
            f"Reference: {self.method} is {metres(self.end_m)} off at the end, {self.end_sigmas:.1f} times what both "
            f"claim, {self.rms_sigmas:.2g} times RMS over time, horizontally."
        )


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
        reference: the method against the reference; None without positions, and where those that agree end early.
        sway: as measured.
        partial: part of the pings with fewer than three beams.
        methods: filters of the case.
        sensors: what they made of each sensor.
        sd_m: claimed σ of the horizontal position at the end, of each method.
        way_m: distance travelled, by dead reckoning where there is one.
        reach_m: greatest distance of the track from its start.
        geometry_open: whether the geometry of recorded beams is a guess.
        heading_open: whether the recorded heading may be magnetic or true.
        assumed: keys of the case that nothing decides.
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
    reference: Reference | None
    sway: Sway | None
    partial: float
    methods: Sequence[str]
    sensors: Sequence[SensorRow]
    sd_m: Mapping[str, float]
    way_m: float
    reach_m: float
    geometry_open: bool
    heading_open: bool = False
    assumed: tuple[str, ...] = ()

    @property
    def judged(self) -> Agreement | None:
        """Agreement of the method to take, or else of the one that stands for all; None without dead reckoning."""
        taken = recommended(self)
        return next(
            (one for one in self.agreements if one.method == taken), next(iter(self.agreements), None)
        )

    @property
    def taken(self) -> str:
        """The method that is judged, or where there is no dead reckoning the one to take."""
        return recommended(self) if self.judged is None else self.judged.method

    @property
    def sd_taken_m(self) -> float:
        """Claimed σ at the end of that method; 0 where there is none."""
        return self.sd_m.get(self.taken, 0.0)

    @property
    def doubted(self) -> SensorRow | None:
        """The sensor beside the beams that contradicts that method most; None without one."""
        rows = [one for one in self.sensors if one.method == self.taken and one.sensor not in ASSUMED]
        rows = [one for one in rows if one.measured >= FEWEST_READINGS]
        doubted = [one for one in rows if one.rejected_part > REJECTED or one.slow_error > SLOW_SIGMAS]
        return max(doubted, key=lambda one: (one.rejected_part, one.slow_error), default=None)


def recommended(evidence: Evidence) -> str:
    """The filter that fits vehicle and beams, of those that stay with dead reckoning.

    An assumption on the sway is worth its risk where pings lack beams, and where complete ones do not contradict it.
    A method that the reference shows to be worse than dead reckoning comes last; dead reckoning takes its place where
    the reference agrees with it. The free inertial navigation is none of them.
    """
    astray = {FREE} | {
        one.method for one in evidence.agreements if one.leaves or one.lost or one.worse or one.vague
    }
    beaten = {one.method for one in evidence.agreements if one.beaten}
    slender = evidence.sway is not None and evidence.sway.fits and evidence.partial > PARTIAL
    order = (RECOMMENDED_METHOD, *TRUSTED) if slender else TRUSTED
    usable = [one for one in (*order, *evidence.methods) if one in evidence.methods and one not in astray]
    usable.sort(key=lambda one: one in beaten)
    first = next((one for one in evidence.agreements if usable and one.method == usable[0]), None)
    if first is not None and first.beaten_beyond(OF_WAY * evidence.way_m):
        return METHOD
    return usable[0] if usable else METHOD if evidence.reckoned else ""


def against_reference(samples: pl.DataFrame, method: str, reference_sd_m: float) -> Reference | None:
    """A method against the reference, horizontally; None without positions.

    Args:
        samples: `files.replay_tables.REPLAY_SAMPLES` of the recording.
        method: whose.
        reference_sd_m: 1 sigma of the reference along an axis.
    """
    rows = samples.filter((pl.col("pass") == FORWARD) & (pl.col("method") == method)).slice(1)
    known = rows.filter(pl.all_horizontal(pl.col(f"err_position_{axis}_m").is_not_null() for axis in AXES))
    if known.is_empty():
        return None
    errors = known.select(f"err_position_{axis}_m" for axis in AXES).to_numpy()
    sd = known.select(f"sd_position_{axis}_m" for axis in AXES).to_numpy()
    end_m, both_m = (
        np.linalg.norm(errors[-1]),
        np.hypot(np.linalg.norm(sd[-1]), np.sqrt(2.0) * reference_sd_m),
    )
    rms = np.sqrt(np.mean((errors / np.hypot(sd, reference_sd_m)) ** 2))
    rms_m = np.sqrt(np.mean((errors**2).sum(axis=1)))
    noise_m = float(np.sqrt(2.0) * reference_sd_m)
    at = rows["time_ns"]
    until = (known["time_ns"][-1] - at[0]) / max(at[-1] - at[0], 1)
    return Reference(method, float(end_m), float(end_m / both_m), float(rms), float(rms_m), noise_m, until)


OF_FILTERS_ALONE = {
    "gyro_unit", "gyro_offset", "start_level", "start_velocity", "start_heading", "depth_sign", "depth_scale",
    "beam_noise", "other_dive",
}  # fmt: skip
"""Causes that dead reckoning does not have: no gyro, no start of the attitude, no weighting of beams. A gyro's
sign is none of them: by the gyros `replay --init` finds frames and clock of the attitude."""

UNSHOWN = {"depth_sign", "depth_scale", "gyro_sign"}
"""Causes that agreement with dead reckoning does not clear: no depth shows in a horizontal track, and clock and frames
of the attitude were told by those gyros."""
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
    cause, reference = next(iter(evidence.causes), None), evidence.reference
    faulty = (
        cause is not None
        and cause.severity == "fault"
        and (cause.kind in UNSHOWN or not _confirmed(evidence, cause))
    )
    further = "" if evidence.sway is None else evidence.sway.words(), evidence.assumed
    beams = ("" if evidence.seen is None else evidence.seen.words(), evidence.closure)
    position = (
        *(one.words() for one in evidence.agreements[:1]),
        "" if reference is None else reference.words(),
    )
    numbers = tuple(filter(None, (" ".join(filter(None, words)) for words in (beams, position))))
    if evidence.state == WRONG or faulty or _refuted(evidence):
        first = cause or evidence.verdict
        reckons = evidence.reckoned and (cause is None or cause.kind in OF_FILTERS_ALONE)
        reckons &= not any(one.reckoned_refuted for one in evidence.agreements)
        return Answer("no", first.text, numbers, first.hint, METHOD if reckons else "", *further)
    method = recommended(evidence)
    for sentence, change in _reasons(evidence):
        return Answer("partly", sentence, numbers, change, method, *further)
    agree = ["dead reckoning"] * evidence.reckoned + ["the reference"] * (reference is not None)
    confirmed = f"{' and '.join(agree)} {'agree' if len(agree) > 1 else 'agrees'}"
    unused = evidence.reckoned and not evidence.aided
    change = NOTHING
    if unused and evidence.agreements and evidence.agreements[0].beaten:
        change = (
            'Set attitude.aids = "heading" or "attitude": dead reckoning with it is nearer to the reference.'
        )
    return Answer("yes", f"The beams fit the navigation, and {confirmed}.", numbers, change, method, *further)


def _reasons(evidence: Evidence) -> Iterator[tuple[str, str]]:
    """Why an answer is "partly" at most, and what to change: what was found, then rules, the gravest first."""
    judged, reference, doubted = evidence.judged, evidence.reference, evidence.doubted
    if evidence.verdict.severity != "note" and evidence.state != ABSORBED:
        yield evidence.verdict.text, evidence.verdict.hint
    # What names no mistake says less than positions that agree.
    settled = "unexplained" if reference is not None and _confirmed(evidence) else ""
    for one in (*evidence.causes, *evidence.further):
        if one.severity != "note" and one.kind != settled:
            yield one.text, one.hint
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
        yield from _unconfirmed(evidence)
    if not evidence.reckoned and (reference is None or not reference.near(evidence.way_m)):
        few = f", {100.0 * evidence.partial:.0f} % of the pings have fewer than three,"
        yield (
            f"The beams fit the navigation{few * (evidence.partial > PARTIAL)} and nothing else confirms it.",
            "Give an [attitude] for dead reckoning by pings of three beams, or positions as [gps].",
        )


def _unconfirmed(evidence: Evidence) -> Iterator[tuple[str, str]]:
    """What nothing decides without a reference."""
    if evidence.geometry_open:
        yield (
            "The geometry of the beams is an open question, and dead reckoning has the same.",
            "Set dvl.geometry to that of the instrument and take it out of assumed, or give positions as [reference].",
        )
    if evidence.heading_open:
        yield (
            "Whether the recorded heading is magnetic or true is an open question, and dead reckoning has the same.",
            "Set attitude.yaw_offset_deg (0 for a true yaw) and take it out of assumed, or give a [reference].",
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


def _refuted(evidence: Evidence) -> bool:
    """Whether the reference contradicts the method's claim, and dead reckoning less."""
    worse = bool(evidence.agreements) and evidence.agreements[0].worse
    return worse and any(one.kind == "claims" for one in evidence.further)
