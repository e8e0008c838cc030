"""What an answer is made of: the findings, the tracks against each other and a reference, and a row a sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.kernel import RECOMMENDED_METHOD
from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.replay.findings.against_reckoning import TRUSTED, Agreement, metres
from bottomlock.replay.findings.limits import (
    AXES,
    FEWEST_READINGS,
    PARTIAL,
    REFERENCE_RMS_SIGMAS,
    REFERENCE_SIGMAS,
    REJECTED,
    SLOW_SIGMAS,
)
from bottomlock.replay.findings.sensors import ASSUMED, SensorRow
from bottomlock.replay.findings.sway import Sway
from bottomlock.replay.findings.verdict import Innovations
from bottomlock.tables.replay import FORWARD

FREE = "ins"
"""Free inertial navigation, the comparison without a DVL."""


@dataclass(frozen=True)
class Reference:
    """A method's horizontal position against the reference.

    Attributes:
        method: whose.
        end_m: distance at the end.
        end_sigmas: the same over the root of the sum of the squares of both σ.
        rms_sigmas: RMS of the error over claimed σ.
    """

    method: str
    end_m: float
    end_sigmas: float
    rms_sigmas: float

    @property
    def agrees(self) -> bool:
        """Whether the claims of both explain the distance."""
        return self.end_sigmas <= REFERENCE_SIGMAS and self.rms_sigmas <= REFERENCE_RMS_SIGMAS

    def words(self) -> str:
        """The comparison in one sentence."""
        return (
            f"Reference: {self.method} is {metres(self.end_m)} off at the end, {self.end_sigmas:.1f} times what both "
            f"claim; error over claimed σ {self.rms_sigmas:.2g} RMS, horizontally."
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
        reference: the method against the reference; None without positions.
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
    What the reference shows to be worse than dead reckoning comes last. The free inertial navigation is none of them.
    """
    astray = {FREE} | {
        one.method for one in evidence.agreements if one.leaves or one.lost or one.worse or one.vague
    }
    beaten = {one.method for one in evidence.agreements if one.beaten}
    slender = evidence.sway is not None and evidence.sway.fits and evidence.partial > PARTIAL
    order = (RECOMMENDED_METHOD, *TRUSTED) if slender else TRUSTED
    usable = [one for one in (*order, *evidence.methods) if one in evidence.methods and one not in astray]
    usable.sort(key=lambda one: one in beaten)
    return usable[0] if usable else METHOD if evidence.reckoned else ""


def against_reference(samples: pl.DataFrame, method: str, reference_sd_m: float) -> Reference | None:
    """A method against the reference, horizontally; None without positions.

    Args:
        samples: `tables.replay.REPLAY_SAMPLES` of the recording.
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
    rms = np.sqrt(np.mean((errors / sd) ** 2))
    return Reference(method, float(end_m), float(end_m / both_m), float(rms))
