"""Tracks against dead reckoning, and against positions that did not aid them: turned as a whole, or of another dive.

Under the hypothesis that both claims are right, the difference of two positions along an axis has at most the variance
σ² + σ_d² where their errors are not opposed; errors of the DVL, which both have, make it smaller. It is looked at in
`TIMES` places and two axes, each at the probability that keeps all of them with 1 − `FALSE_ALARM` (Bonferroni, for any
dependence): a right pair is reported once in 10,000 dives at most. The threshold is 4.7 σ.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from bottomlock.files.replay_tables import FORWARD
from bottomlock.own_method import DEAD_RECKONING as METHOD
from bottomlock.recordings.finding import Finding
from bottomlock.recordings.streams import Floats, Times
from bottomlock.recordings.track_fit import TrackFit, fit_track
from bottomlock.replay.case import Case
from bottomlock.replay.findings.limits import (
    AXES,
    LIMIT,
    LOST,
    OF_WAY,
    REFERENCE_RMS_SIGMAS,
    REFERENCE_SIGMAS,
    TIMES,
    TURNED_SIGMAS,
    UNUSED,
    VAGUE,
    WORSE,
)
from bottomlock.replay.streams import Streams

TRUSTED = ("tc", "info", "lc", "sway_current", "weak_sway")
"""Methods that claim to be consistent; `ins` has no aid and the others are the paper's."""


@dataclass(frozen=True)
class Agreement:
    """A method against dead reckoning, in the horizontal plane.

    Attributes:
        method: the method.
        apart_m: largest distance at the times that are looked at.
        sigmas: largest difference over the combined σ of both.
        own_sigmas: the same over the σ of dead reckoning alone.
        sd_m, reckoned_sd_m: claimed σ at the end, root of the sum over both axes.
        rms_m, reckoned_rms_m: RMS against the reference; NaN without one, which no comparison holds for.
        reference_sd_m: 1 sigma of the reference, root of the sum over both axes.
    """

    method: str
    apart_m: float
    sigmas: float
    own_sigmas: float
    sd_m: float
    reckoned_sd_m: float
    rms_m: float
    reckoned_rms_m: float
    reference_sd_m: float = 0.0

    @property
    def leaves(self) -> bool:
        """Whether the method is further off than both claim, and the reference does not show that it is right."""
        return self.sigmas > LIMIT and not self.confirmed_alone

    @property
    def lost(self) -> bool:
        """Whether it is further off than dead reckoning claims, and says itself that it does not know where it is."""
        vague = self.own_sigmas > LIMIT and self.sd_m > LOST * self.reckoned_sd_m
        return vague and not self.leaves and not self.confirmed_alone

    @property
    def departs(self) -> bool:
        """Whether it is further from dead reckoning than a right method can be."""
        return self.leaves or self.lost

    @property
    def confirmed_alone(self) -> bool:
        """Whether the reference confirms the method, and not dead reckoning: a compass that stands still."""
        explained_m = REFERENCE_SIGMAS * math.hypot(self.sd_m, self.reference_sd_m)
        nearer = self.reckoned_rms_m > WORSE * self.rms_m and self.rms_m <= explained_m
        return nearer and not self._reckoned_fits

    @property
    def beaten(self) -> bool:
        """Whether the reference prefers dead reckoning."""
        return self.rms_m > WORSE * self.reckoned_rms_m

    def beaten_beyond(self, near_m: float) -> bool:
        """Whether to take dead reckoning, which fits the reference: the method is beaten and over `near_m` off."""
        return self.beaten and self.rms_m > near_m and self._reckoned_fits

    @property
    def reckoned_refuted(self) -> bool:
        """Whether the reference contradicts dead reckoning."""
        return math.isfinite(self.reckoned_rms_m) and not self._reckoned_fits

    @property
    def _reckoned_fits(self) -> bool:
        """Whether its claim and the reference's noise explain the error of dead reckoning."""
        explained_m = REFERENCE_SIGMAS * math.hypot(self.reckoned_sd_m, self.reference_sd_m)
        return self.reckoned_rms_m <= explained_m

    @property
    def worse(self) -> bool:
        """Whether it is worse by more than the claims of both and the reference's noise explain."""
        if not self.beaten:
            return False
        explained_m = math.hypot(self.sd_m, self.reckoned_sd_m, self.reference_sd_m)
        return math.sqrt(self.rms_m**2 - self.reckoned_rms_m**2) > explained_m

    @property
    def vague(self) -> bool:
        """Whether its claim is so much larger than that of dead reckoning, if that is right, that it is of no use."""
        return self.sd_m > VAGUE * self.reckoned_sd_m and not self.confirmed_alone

    def departure(self) -> str:
        """How far it is from dead reckoning, in one sentence."""
        return (
            f"{self.method} is up to {metres(self.apart_m)} from dead reckoning: {self.sigmas:.1f} times what both "
            f"claim, {self.own_sigmas:.0f} times what dead reckoning claims."
        )

    def words(self) -> str:
        """The comparison in one sentence."""
        alone = f" and {self.own_sigmas:.0f} times what dead reckoning claims" if self.lost else ""
        text = (
            f"{self.method} is at most {metres(self.apart_m)} from dead reckoning: {self.sigmas:.1f} times what both "
            f"claim{alone}, of {LIMIT:.1f} that chance explains."
        )
        if math.isfinite(self.rms_m + self.reckoned_rms_m):
            text += (
                f" Position RMS against the reference, horizontally: {self.method} {metres(self.rms_m)}, dead "
                f"reckoning {metres(self.reckoned_rms_m)}."
            )
        return text


def metres(value: float) -> str:
    """A distance with its unit.

    >>> metres(0.1234), metres(1412345.0)
    ('0.123 m', '1,412,345 m')
    """
    return f"{value:.3g} m" if value < 1000.0 else f"{value:,.0f} m"


def agreements(samples: pl.DataFrame, methods: Sequence[str], reference_sd_m: float = 0.0) -> list[Agreement]:
    """Every trusted method against dead reckoning; none where it was not possible.

    Args:
        samples: `files.replay_tables.REPLAY_SAMPLES` of the recording.
        methods: of the tables.
        reference_sd_m: 1 sigma of the reference along an axis.
    """
    forward = samples.filter(pl.col("pass") == FORWARD)
    reckoned = forward.filter(pl.col("method") == METHOD)
    if reckoned.height < 2:
        return []
    rows = np.unique(np.linspace(0, reckoned.height - 1, TIMES + 1).round().astype(int))[1:]
    place, sd, error = _columns(reckoned)
    found = []
    for method in (one for one in TRUSTED if one in methods):
        own_place, own_sd, own_error = _columns(forward.filter(pl.col("method") == method))
        difference = (own_place - place)[rows]
        found.append(
            Agreement(
                method=method,
                apart_m=float(np.linalg.norm(difference, axis=1).max()),
                sigmas=float((np.abs(difference) / np.hypot(own_sd, sd)[rows]).max()),
                own_sigmas=float((np.abs(difference) / sd[rows]).max()),
                sd_m=float(np.linalg.norm(own_sd[-1])),
                reckoned_sd_m=float(np.linalg.norm(sd[-1])),
                rms_m=_rms(own_error),
                reckoned_rms_m=_rms(error),
                reference_sd_m=float(np.sqrt(len(AXES)) * reference_sd_m),
            )
        )
    return found


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


def _columns(rows: pl.DataFrame) -> tuple[Floats, Floats, Floats]:
    """Position, σ and error of the horizontal axes, (T, 2) each; NaN for an error that is not known."""
    return (
        rows.select(f"{axis}_m" for axis in AXES).to_numpy(),
        np.maximum(rows.select(f"sd_position_{axis}_m" for axis in AXES).to_numpy(), 1e-3),
        rows.select(pl.col(f"err_position_{axis}_m").fill_null(np.nan) for axis in AXES).to_numpy(),
    )


def _rms(error: Floats) -> float:
    known = np.isfinite(error).all(axis=1)
    return float(np.sqrt((error[known] ** 2).sum(axis=1).mean())) if known.any() else math.nan


def fits(case: Case, streams: Streams, time_ns: Times, track_t_m: Floats, claimed_m: float) -> list[TrackFit]:
    """A track (T, 3) with the RMS σ that it claims against the reference and GPS, where there are positions of them."""
    found = []
    reference, gps = streams.reference, streams.gps
    if reference is not None and reference.position_t_m is not None:
        found.append(
            fit_track("reference", time_ns, track_t_m, reference.time_ns, reference.position_t_m, claimed_m)
        )
    if gps is not None and case.gps is not None:
        found.append(fit_track("gps", time_ns, track_t_m, gps.time_ns, gps.position_t_m, claimed_m))
    return [one for one in found if one is not None]


def track_finding(case: Case, track: list[TrackFit], reckoned: list[TrackFit]) -> Finding | None:
    """What is turned, or not of this dive, by a method's track and that of dead reckoning against the same positions.

    Args:
        case: the case.
        track: of the method.
        reckoned: of dead reckoning; empty without one.
    """
    claimed_rad = TURNED_SIGMAS * _claimed_yaw_rad(case)
    for k, one in enumerate(track):
        beside = reckoned[k] if k < len(reckoned) else None
        if (beside or one).unlike:
            return _other_dive(one, beside)
        if beside is not None and beside.turned and not one.turned and abs(beside.angle_rad) > claimed_rad:
            return _attitude_turned(case, beside)
        if (
            one.turned
            and abs(one.angle_rad) > claimed_rad
            and (one.name == "reference" or case.gps is None or not case.gps.aids)
        ):
            return _track_turned(case, one)
    return None


def _claimed_yaw_rad(case: Case) -> float:
    """1 sigma of the slow error of the yaw that the case claims of an attitude that aids; 0 without one."""
    attitude = case.attitude
    if attitude is None or attitude.aids == "nothing":
        return 0.0
    return float(np.deg2rad(np.hypot(attitude.yaw_constant_sd_deg, attitude.yaw_walk_sd_deg)))


def _other_dive(one: TrackFit, beside: TrackFit | None) -> Finding:
    best = beside or one
    what = "dead-reckoned track" if beside is not None else "track"
    return Finding(
        "other_dive", "fault", best.after_m / max(best.extent_m, 1e-9),
        f"The positions of [{one.name}] are not of this dive: no turn and no shift makes one of the other.",
        f"RMS distance to the {what} {best.before_m:.3g} m as it is, {best.after_m:.3g} m after the turn and shift "
        f"that fit best; the positions extend over {best.extent_m:.3g} m RMS, the track over {best.own_extent_m:.3g}.",
        f"Check {one.name}.file and {one.name}.clock: are both of the same dive and on the same clock?",
        f"{one.name}.file",
    )  # fmt: skip


def _attitude_turned(case: Case, fit: TrackFit) -> Finding:
    degrees = float(np.rad2deg(fit.angle_rad))
    offset = 0.0 if case.attitude is None else case.attitude.yaw_offset_deg
    return Finding(
        "attitude_heading", "fault", (fit.angle_rad / fit.whole_sd_rad) ** 2,
        f"The heading of [attitude] is {-degrees:+.1f} deg off: dead reckoning with it is turned against the positions "
        f"of [{fit.name}].",
        f"RMS distance {fit.before_m:.1f} m as reckoned, {fit.after_m:.1f} m after turning it back.",
        f"Set attitude.yaw_offset_deg = {degrees + offset:.1f}, or attitude.mounting_yaw_deg if the instrument is "
        "turned.",
        "attitude.yaw_offset_deg",
    )  # fmt: skip


def _track_turned(case: Case, fit: TrackFit) -> Finding:
    degrees = float(np.rad2deg(fit.angle_rad))
    aided = case.attitude is not None and case.attitude.aids != "nothing"
    cause = (
        "the recorded heading aids it: a magnetic one lacks the declination"
        if aided
        else "its heading at the start was wrong"
    )
    remedy = (
        f"Set attitude.yaw_offset_deg = {degrees + case.attitude.yaw_offset_deg:.1f}"
        if aided and case.attitude is not None
        else "Use another source of start.heading"
    )
    return Finding(
        "magnetic_heading" if aided else "start_heading", "fault", (fit.angle_rad / fit.whole_sd_rad) ** 2,
        f"The track is turned by {-degrees:+.1f} deg against the positions of [{fit.name}]; {cause}.",
        f"RMS distance {fit.before_m:.1f} m as navigated, {fit.after_m:.1f} m after turning it back.",
        f"{remedy}; is it true north?", "attitude.yaw_offset_deg" if aided else "start.heading",
    )  # fmt: skip
