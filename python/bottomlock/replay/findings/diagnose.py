"""The findings of a replay, the likely causes first; and the answer that they amount to."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from bottomlock.files.replay_tables import FORWARD
from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.attitude_fit import AttitudeFit
from bottomlock.recordings.axes import to_angles
from bottomlock.recordings.closure import closure_sd
from bottomlock.recordings.finding import Finding, ranked
from bottomlock.recordings.pings import LEAST_PINGS
from bottomlock.recordings.rig_fit import Recorded
from bottomlock.recordings.stream_sections import ImuStream
from bottomlock.recordings.streams import Floats, Integers
from bottomlock.recordings.track_fit import TrackFit
from bottomlock.replay.case import Case
from bottomlock.replay.findings import checks
from bottomlock.replay.findings.attitude_checks import attitude_findings, gyro_fit, heading_findings
from bottomlock.replay.findings.claims import claims_findings
from bottomlock.replay.findings.earth import earth_findings
from bottomlock.replay.findings.hypotheses import compare, tight_priors
from bottomlock.replay.findings.innovations import Innovations, innovations_of, least_ratio, no_fix
from bottomlock.replay.findings.limits import UNUSED
from bottomlock.replay.findings.motion_findings import Stated, motion_findings
from bottomlock.replay.findings.sensors import SensorRow
from bottomlock.replay.findings.sway import measured_sway
from bottomlock.replay.findings.tracks import Agreement, against_reference, agreements, fits, track_finding
from bottomlock.replay.findings.trust import Evidence
from bottomlock.replay.findings.verdict import Answer, answer_of
from bottomlock.replay.read_tables import NEAR
from bottomlock.replay.rerun import PreparedRun
from bottomlock.replay.screen_aiding import MANY, left_out_findings
from bottomlock.replay.vehicle_motion import at_imu, whole_pings
from bottomlock.statistics.replay import track_table


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Findings in order, and the answer to whether the replay can be trusted."""

    findings: list[Finding]
    answer: Answer


def diagnose(
    case: Case,
    prepared: PreparedRun,
    samples: pl.DataFrame,
    innovations: pl.DataFrame,
    sensors: Sequence[SensorRow],
) -> Diagnosis:
    """Of the recording as it is: the likely causes, claims that a reference contradicts, and the answer.

    Args:
        case: the case.
        prepared: its start and settings.
        samples: `files.replay_tables.REPLAY_SAMPLES` of the recording.
        innovations: the same, `files.replay_tables.innovations_schema`.
        sensors: the same, of every method.
    """
    methods = case.replay.filters
    causes = _causes(case, prepared, samples)
    beams = pl.Series(prepared.streams.beams.valid[prepared.pings].sum(axis=1))
    projected = prepared.streams.beams.velocity_d_mps is not None
    # Beams projected from a velocity have its noise three times over, and no closure.
    least = 0.0 if projected else least_ratio(prepared.options.robust)
    seen = innovations_of(innovations, methods, beams, least)
    reference_sd_m = 0.0 if case.reference is None else case.reference.sd_m
    agreed = agreements(samples, methods, reference_sd_m)
    if seen is None:
        causes = [no_fix(), *causes]
    else:
        agreed.sort(key=lambda one: one.method != seen.method)
    further = [
        *_astray(agreed),
        *claims_findings(samples, methods, reference_sd_m),
        *earth_findings(prepared.model.environment, samples),
        *left_out_findings(prepared.streams.left_out),
        *_beyond_track(case, prepared),
        *([] if seen is None else heading_findings(prepared, samples, seen.method)),
    ]
    reference = None if seen is None else against_reference(samples, seen.method, reference_sd_m)
    tracks = _tracks(samples)
    stands = DEAD_RECKONING if DEAD_RECKONING in tracks else methods[0] if seen is None else seen.method
    evidence = Evidence(
        causes=causes, further=further, seen=seen,
        closure=next(iter(checks.closure_words(prepared)), ""),
        agreements=agreed, reckoned=bool((samples["method"] == DEAD_RECKONING).any()),
        aided=case.attitude is not None and case.attitude.aids != "nothing",
        reference=None if reference is None or (reference.agrees and not reference.confirms) else reference,
        sway=measured_sway(case, prepared, *_heading(prepared, samples, seen)),
        partial=float(np.mean(prepared.streams.beams.valid[prepared.pings].sum(axis=1) < 3)),
        methods=methods,
        sensors=sensors,
        sd_m={name: row["sd_m"] for name, row in tracks.items()},
        way_m=tracks[stands]["way_m"],
        reach_m=_reach_m(samples, stands),
        projected=projected,
        assumed=case.assumed,
    )  # fmt: skip
    answer = answer_of(evidence)
    if answer.verdict != "no":
        causes = [replace(one, severity="warning") for one in causes]
    return Diagnosis([*causes, *further], answer)


def _beyond_track(case: Case, prepared: PreparedRun) -> list[Finding]:
    """Pings that aid a part of the dive alone: a DVL that begins late, a clock that was set, a file that ends early."""
    set_once = _clock_set(prepared)
    beams, inertial_ns = prepared.streams.beams, prepared.streams.inertial.time_ns
    pings_ns = beams.time_ns[beams.valid.any(axis=1)]
    # A case that states a duration asks for a part.
    if set_once or not len(pings_ns) or case.replay.duration_s is not None:
        return set_once
    first_ns, last_ns = min(pings_ns[0], inertial_ns[0]), max(pings_ns[-1], inertial_ns[-1])
    begins_ns = max(pings_ns[0], prepared.alignment.time_ns)
    ends_ns = min(pings_ns[-1], prepared.sample_time_ns[-1])
    before, after = (
        float(ns) / float(last_ns - first_ns) for ns in (begins_ns - first_ns, last_ns - ends_ns)
    )
    part = before + after
    if part < UNUSED:
        return []
    return [
        Finding(
            "beyond_track", "warning", part,
            f"The pings aid a part of the dive: {100.0 * part:.0f} % of its time is before or after them.",
            f"{100.0 * before:.0f} % lie before the first ping of the track, {100.0 * after:.0f} % after the last; the "
            "dive is the time of IMU and pings, and the track ends with the IMU.",
            "Check start.at_s, and which file begins late or ends early, or cut all files to the time with pings.",
            "start.at_s",
            size=part, unit="1", expected="pings over all of the dive",
        )
    ]  # fmt: skip


def _clock_set(prepared: PreparedRun) -> list[Finding]:
    """A clock that was set during the dive, so that pings lie outside the times of the IMU."""
    streams = prepared.streams
    set_once = [
        name for name in ("imu", "dvl") if name in streams.clocks and streams.clocks[name].jumps.count
    ]
    unused = 1.0 - len(streams.beams.time_ns[prepared.pings]) / max(len(streams.beams.time_ns), 1)
    if not set_once or unused < MANY:
        return []
    report = streams.clocks[set_once[0]]
    return [
        Finding(
            "clock_set", "warning", unused,
            f"The clock of [{set_once[0]}] was set during the dive; {100.0 * unused:.0f} % of the pings are not used.",
            f"Steps longer than {set_once[0]}.clock.jump_s: {report.jumps.text}.",
            "Cut the files at the step, or bring both parts to one clock.", f"{set_once[0]}.clock.column",
            size=unused, unit="1", expected="times that rise by the rate of the readings",
        )
    ]  # fmt: skip


def _tracks(samples: pl.DataFrame) -> dict[str, dict[str, float]]:
    """Distance travelled and horizontal σ at the end, `way_m` and `sd_m`, by method."""
    sd = (pl.col("sd_position_north_m") ** 2 + pl.col("sd_position_east_m") ** 2).sqrt()
    rows = track_table(samples).filter(pl.col("pass") == FORWARD).select("method", "way_m", sd_m=sd)
    return {row["method"]: row for row in rows.iter_rows(named=True)}


def _reach_m(samples: pl.DataFrame, method: str) -> float:
    rows = samples.filter((pl.col("pass") == FORWARD) & (pl.col("method") == method))
    place = rows.select("north_m", "east_m").to_numpy()
    return float(np.linalg.norm(place - place[0], axis=1).max())


def _heading(
    prepared: PreparedRun, samples: pl.DataFrame, seen: Innovations | None
) -> tuple[Integers, Floats]:
    """Times and headings, rad: as recorded, else those of the method that stands for all."""
    attitudes = prepared.streams.attitudes
    if attitudes is not None:
        return attitudes.time_ns, to_angles(attitudes.attitude)[:, 2]
    method = samples["method"][0] if seen is None else seen.method
    rows = samples.filter((pl.col("pass") == "forward") & (pl.col("method") == method))
    return rows["time_ns"].to_numpy(), np.deg2rad(rows["yaw_deg"].to_numpy())


def _astray(agreed: list[Agreement]) -> list[Finding]:
    """Methods beside the one of the verdict that leave dead reckoning, where that one does not."""
    astray = [one for one in agreed[1:] if one.departs]
    if not astray or agreed[0].departs:
        return []
    worst = max(astray, key=lambda one: one.sigmas)
    return [
        Finding(
            "astray", "warning", worst.sigmas**2,
            f"{', '.join(one.method for one in astray)}: further from dead reckoning than both claim, and "
            f"{agreed[0].method} is not.",
            worst.words(), f"Take {agreed[0].method}: what the others assume does not hold on this dive.",
        )
    ]  # fmt: skip


def _causes(case: Case, prepared: PreparedRun, samples: pl.DataFrame) -> list[Finding]:
    streams, alignment = prepared.streams, prepared.alignment
    found = [checks.order_finding(streams) or checks.beam_noise_finding(case, streams)]
    time_ns, velocity = whole_pings(streams, streams.beams)
    gyros = gyro_fit(case, prepared)
    inside = time_ns >= alignment.time_ns
    time_ns, velocity = time_ns[inside], velocity[inside]
    # Readings that are made from the attitude and the DVL itself say nothing about the DVL.
    if len(time_ns) > LEAST_PINGS and isinstance(case.imu, ImuStream):
        found += _against_imu(case, prepared, time_ns, velocity, gyros)
    elif len(time_ns) > LEAST_PINGS and case.attitude is not None and streams.attitudes is not None:
        sd_mps = _noise_mps(prepared)
        sinking = checks.sinking_by_attitude(case.attitude, streams.attitudes, time_ns, velocity, sd_mps)
        found.append(checks.depth_finding(case, streams, sinking))
    against = attitude_findings(case, gyros)
    moved = {one.kind for one in found if one is not None}
    # One unit has one finding; and axes that are wrong turn the attitude against the IMU too.
    found += [
        one for one in against if one.kind not in moved and (one.kind == "gyro_unit" or "axes" not in moved)
    ]
    found += [
        checks.velocity_finding(alignment, time_ns, velocity),
        checks.heading_finding(case, alignment, streams),
    ]
    causes = ranked([one for one in found if one is not None])
    return _with_track(causes, _track(case, prepared, samples))


def _with_track(causes: list[Finding], track: Finding | None) -> list[Finding]:
    """The causes with what the track shows, each mistake once."""
    # A start that contradicts an attitude which is wrong is the mistake of the attitude.
    others = [one for one in causes if one.kind != "start_heading"]
    if any(one.kind == "attitude_mounting" for one in causes):
        return others
    if track is None:
        return causes
    if track.kind in {"attitude_heading", "other_dive"}:
        # Both are told only where nothing else makes dead reckoning wrong.
        return causes if any(one.severity == "fault" for one in others) else ranked([*others, track])
    return ranked([*causes, track])


def _against_imu(
    case: Case, prepared: PreparedRun, time_ns: Integers, velocity: Floats, gyros: AttitudeFit | None
) -> list[Finding | None]:
    streams, alignment = prepared.streams, prepared.alignment
    inertial = prepared.readings
    rows = slice(int(np.searchsorted(inertial.time_ns, alignment.time_ns)), None)
    recorded = Recorded(
        inertial.rows(rows), time_ns,
        at_imu(streams, inertial, time_ns, velocity),
    )  # fmt: skip
    model = prepared.model.imu
    tight = tight_priors(model.gyro_bias_sd_radps, model.accel_bias_sd_mps2)
    known = gyros is not None and 1.0 / NEAR < gyros.scale < NEAR
    comparison = compare(recorded, tight, _noise_mps(prepared), unit_is_right=known)
    if comparison is None:
        return []
    # About the axis around which the beams are arranged.
    B = np.asarray(streams.instrument.geometry.directions_p)
    down = B.mean(axis=0) / max(float(np.linalg.norm(B.mean(axis=0))), 1e-9)
    tilt = float(np.mean(np.arccos(np.clip(np.abs(B @ down), -1.0, 1.0))))
    found: list[Finding | None] = [
        *motion_findings(Stated(case, streams.instrument.mounting_rpy_rad, tilt), comparison)
    ]
    # Not the free fit: at a constant speed it may lean on a mounting that nothing shows.
    best = comparison.causes[0].match if comparison.causes else comparison.stated
    factor = comparison.causes[0].mistake.gyros if comparison.causes else 1.0
    if np.all(np.asarray(factor) == 1.0) and abs(best.gravity - 9.81) < 0.5:
        found.append(checks.level_finding(alignment, best))
        sinking = checks.sinking_by_imu(recorded, best, tight["accel_bias"])
        found.append(checks.depth_finding(case, streams, sinking))
    return found


def _noise_mps(prepared: PreparedRun) -> float:
    """Noise of a velocity, per axis, as claimed or as the closure shows, whichever is more."""
    beams, instrument = prepared.streams.beams, prepared.streams.instrument
    B = np.asarray(instrument.geometry.directions_p)
    whole = beams.velocity_mps[beams.valid.all(axis=1)]
    measured = float(np.nan_to_num(closure_sd(B, whole))) if len(whole) >= LEAST_PINGS else 0.0
    beam_sd = max(float(instrument.beam_sd_mps.mean()), measured)
    return float(beam_sd * np.sqrt(np.trace(np.linalg.pinv(B.T @ B)) / 3.0))


def _track(case: Case, prepared: PreparedRun, samples: pl.DataFrame) -> Finding | None:
    methods = [m for m in ("tc", "lc", *case.replay.filters) if m in case.replay.filters and m != "ins"]
    if not methods:
        return None
    own, reckoned = (_fits(case, prepared, samples, method) for method in (methods[0], DEAD_RECKONING))
    return track_finding(case, own, reckoned)


def _fits(case: Case, prepared: PreparedRun, samples: pl.DataFrame, method: str) -> list[TrackFit]:
    rows = samples.filter((pl.col("pass") == "forward") & (pl.col("method") == method))
    if rows.height < 2:
        return []
    place = rows.select("north_m", "east_m", "down_m").to_numpy()
    sd = rows.select("sd_position_north_m", "sd_position_east_m").to_numpy()
    claimed_m = float(np.sqrt((sd**2).sum(axis=1).mean()))
    return fits(case, prepared.streams, rows["time_ns"].to_numpy(), place, claimed_m)
