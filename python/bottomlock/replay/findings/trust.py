"""What tells whether a replay can be trusted: rows of its sensors, tracks against each other, findings, open keys."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.innovations import Innovations
from bottomlock.replay.findings.limits import FEWEST_READINGS, OF_WAY, PARTIAL, REJECTED, SLOW_SIGMAS
from bottomlock.replay.findings.sensors import ASSUMED, SensorRow
from bottomlock.replay.findings.sway import Sway
from bottomlock.replay.findings.tracks import TRUSTED, Agreement, Reference

FREE = "ins"
"""Free inertial navigation, the comparison without a DVL."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What an answer is made of.

    Attributes:
        causes: the likely causes, the likeliest first.
        further: findings after them.
        seen: innovations; None without a fix.
        closure: what beams left out show, in a sentence; "" without redundant beams.
        agreements: of the trusted methods with dead reckoning, that of `seen` first.
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
        projected: whether the beams are made of a velocity, so that their geometry moves no track.
        assumed: keys of the case that nothing decides.
    """

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
    projected: bool
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
    astray = {FREE} | {one.method for one in evidence.agreements if one.departs or one.worse or one.vague}
    beaten = {one.method for one in evidence.agreements if one.beaten}
    slender = evidence.sway is not None and evidence.sway.fits and evidence.partial > PARTIAL
    order = (RECOMMENDED_METHOD, *TRUSTED) if slender else TRUSTED
    usable = [one for one in (*order, *evidence.methods) if one in evidence.methods and one not in astray]
    usable.sort(key=lambda one: one in beaten)
    first = next((one for one in evidence.agreements if usable and one.method == usable[0]), None)
    if first is not None and first.beaten_beyond(OF_WAY * evidence.way_m):
        return METHOD
    return usable[0] if usable else METHOD if evidence.reckoned else ""
