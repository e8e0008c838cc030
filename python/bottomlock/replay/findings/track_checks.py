"""Tracks against positions that did not aid them: turned as a whole, or of another dive."""

import numpy as np

from bottomlock.recordings.finding import Finding
from bottomlock.recordings.streams import Floats, Times
from bottomlock.recordings.track_fit import TrackFit, fit_track
from bottomlock.replay.case import Case
from bottomlock.replay.findings.limits import TURNED_SIGMAS
from bottomlock.replay.streams import Streams


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
