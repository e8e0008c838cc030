"""A whole audit: the log, the other recordings of the same time, and all findings."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bottomlock.audit import defects
from bottomlock.audit.beam_findings import closure_findings
from bottomlock.audit.beams import BeamAssessment, assess_beams
from bottomlock.audit.closure import Closure, closure_of
from bottomlock.audit.defects import lock_findings, noisy_findings, stuck_findings
from bottomlock.audit.depth import DepthRate, depth_findings, depth_rate
from bottomlock.audit.logs import BeamLog, Reference, read_log, read_own_attitude
from bottomlock.audit.matrix import LEAST_PINGS
from bottomlock.audit.mounting import Mounting, find_mounting
from bottomlock.audit.mounting_findings import Mounted, mounting_findings
from bottomlock.audit.robust import Array
from bottomlock.audit.water import WaterAgreement, water_agreement, water_findings
from bottomlock.files.atomic_write import plain
from bottomlock.io.beam_table import WaterTable, read_water_table, water_file
from bottomlock.io.beams import check_beam_count, packaged_geometries, read_geometry
from bottomlock.kernel import BeamGeometry
from bottomlock.recordings.closure import closure_sd
from bottomlock.recordings.finding import Finding, ranked
from bottomlock.recordings.streams import Depths, Inertial
from bottomlock.support.rising import rising

OTHER_INSTRUMENT = {"swapped_beams", "sign_flipped", "order_or_bias", "rotated_geometry"}
"""Findings that another geometry may explain; so does a wrong direction of every beam."""


def packaged_findings(
    log: BeamLog,
    found: BeamAssessment,
    stated: Array | None,
    copies: list[tuple[int, ...]],
    name: str | None,
) -> list[Finding]:
    """The packaged geometry that fits where the stated one, called `name`, does not, or where none is stated.

    A geometry fits where the audit against it finds no fault of the beams. Closure alone shows neither tilt nor yaw:
    without the instrument's velocity several geometries fit where a stated one does not, and all of them are named.

    Args:
        log: the pings.
        found: assessment against the stated geometry.
        stated: (beams, 3) its directions in the frame of the instrument's velocity, or None.
        copies: pairs of channels found before to hold the same numbers.
        name: of the stated geometry; None where none is stated.
    """
    regressed = found.matrix is not None and bool(found.matrix.observable.all())
    judged = regressed or (stated is not None and log.beams >= 4)
    if found.full.sum() < LEAST_PINGS or not judged or not _open(found, stated):
        return []
    tried = {
        one: geometry.sound_speed_scale * np.asarray(geometry.directions_p)
        for one in packaged_geometries()
        if (geometry := read_geometry(one).geometry).beams == log.beams
    }
    fits = [one for one, rows in tried.items() if one != name and _fits(log, found, rows, copies)]
    if not fits:
        return []
    readings = log.velocity_mps[found.full]
    named = {one: tried[one] for one in fits} | ({} if stated is None or name is None else {name: stated})
    closures = {one: 1e3 * closure_sd(rows, readings) for one, rows in named.items()}
    sizes = ", ".join(f"{size:.1f} with {one}" for one, size in closures.items() if np.isfinite(size))
    evidence = f"Robust closure of a unit combination, mm/s: {sizes}." if sizes else ""
    if len(fits) > 1:
        options = f"{', '.join(fits[:-1])} or {fits[-1]}"
        words = f"The beams fit the packaged geometries {options}."
        advice = "State that of your instrument with --geometry; closure alone shows neither tilt nor yaw."
        return [
            Finding(
                "packaged_geometries",
                "note",
                1.0,
                words,
                evidence,
                advice,
                size=float(len(fits)),
                unit="geometries",
            )
        ]
    (only,) = fits
    if regressed and found.matrix is not None:
        unit = tried[only] / np.linalg.norm(tried[only], axis=1)[:, None]
        off = np.arccos(np.clip((found.matrix.directions * unit).sum(axis=1), -1.0, 1.0))
        evidence += (
            f" Every beam is within {np.rad2deg(off.max()):.2f} deg of {only}, by the instrument's velocity."
        )
    return [
        Finding(
            *(("packaged_geometries", "note") if stated is None else ("another_geometry", "fault")),
            1.0,
            f"This is {only}{'' if name is None else f', not {name}'}.", evidence.strip(),
            f"Audit and solve with --geometry {only}.",
            size=1.0, unit="geometries",
        )
    ]  # fmt: skip


def _open(found: BeamAssessment, stated: Array | None) -> bool:
    """No geometry is stated, or what is found against it may be that of another instrument."""
    if stated is None:
        return True
    return any(
        one.kind in OTHER_INSTRUMENT or (one.kind == "mistilted_beam" and len(one.beams) == len(stated))
        for one in found.findings
    )


def _fits(log: BeamLog, found: BeamAssessment, rows: Array, copies: list[tuple[int, ...]]) -> bool:
    other = assess_beams(log, found.full, rows, copies)
    return all(one.severity != "fault" for one in other.findings)


@dataclass(frozen=True, eq=False)
class Audit:
    """Result of an audit.

    Attributes:
        log: the pings.
        unchanged: (n,) pings that repeat the one before them.
        assessment: of the beams.
        depth: depth rate against heave, or None.
        mounting: mounting of the DVL, or None.
        findings: ranked, the worst first.
        geometry_name: name of the geometry that the log was compared with, or None.
        stated: (beams, 3) its directions, or None.
        water: the water against the bottom, or None.
    """

    log: BeamLog
    unchanged: NDArray[np.bool_]
    assessment: BeamAssessment
    depth: DepthRate | None
    mounting: Mounting | None
    findings: list[Finding]
    geometry_name: str | None
    stated: NDArray[np.float64] | None = None
    water: WaterAgreement | None = None


def audit_log(
    log: BeamLog,
    *,
    stated: BeamGeometry | None = None,
    geometry_name: str | None = None,
    mounting_rpy_rad: ArrayLike = (0.0, 0.0, 0.0),
    reference: Reference | None = None,
    imu: Inertial | None = None,
    depths: Depths | None = None,
    water: WaterTable | None = None,
    own_attitude: Reference | None = None,
) -> Audit:
    """Audits a log that has been read.

    Args:
        log: from `bottomlock.audit.logs.read_log`.
        stated: geometry to compare with, in the platform frame.
        mounting_rpy_rad: roll, pitch, yaw from DVL axes to platform axes that `stated` contains.
        geometry_name: its name in the report.
        reference, imu, depths: other recordings of the same time.
        water: cells of water of the same instrument.
        own_attitude: as the instrument recorded it, for the water where there is no reference.

    Raises:
        DataError: for a geometry or water with another number of beams than the log.

    Examples:
        >>> from bottomlock import BeamGeometry
        >>> rng, janus = np.random.default_rng(3), BeamGeometry.janus(0.35)
        >>> motion = rng.normal(size=(400, 3)) * [0.5, 0.3, 0.2]
        >>> readings = janus.beam_velocities(motion) + 0.01 * rng.normal(size=(400, 4))
        >>> own = readings @ np.linalg.pinv(janus.directions_p).T
        >>> log = BeamLog("dive", np.arange(400) * 10**8, readings[:, [1, 0, 2, 3]], np.ones((400, 4), bool), None, own)
        >>> [(one.kind, one.beams) for one in audit_log(log, stated=janus).findings]
        [('swapped_beams', (1, 2))]
    """
    if stated is not None and log.beams:
        check_beam_count(log.place, log.beams, stated.beams)
    mounted = Mounted() if stated is None else Mounted.of(stated, mounting_rpy_rad)
    directions = None
    if stated is not None and log.beams:
        directions, mounted = mounted.directions(stated, log)
    same = defects.unchanged(log)
    if log.stale is not None:
        same = same | log.stale
    unlocked = lock_findings(log)
    if unlocked:
        assessment = BeamAssessment(full=np.zeros(log.pings, dtype=bool))
        told = [*unlocked, *defects.time_findings(log), *converter_findings(log)]
        return Audit(log, same, assessment, None, None, ranked(told), geometry_name, directions)
    copies, zeros = defects.copy_findings(log), defects.zero_findings(log)
    findings = [
        *defects.time_findings(log),
        *defects.stale_findings(log, same),
        *stuck_findings(log, same),
        *zeros,
        *copies,
        *defects.range_findings(log),
        *defects.instrument_flag_findings(log, same),
    ]
    whole = log.full & ~same
    assessment = BeamAssessment(full=np.zeros(log.pings, dtype=bool))
    if log.beams >= 1:
        reading_zero = [beam - 1 for one in zeros for beam in one.beams]
        whole &= (log.velocity_mps[:, reading_zero] != 0.0).all(axis=1)
        pairs = [one.beams for one in copies]
        assessment = assess_beams(log, whole, directions, pairs)
        if stated is None or geometry_name in packaged_geometries():
            findings += packaged_findings(log, assessment, directions, pairs, geometry_name)
    findings += noisy_findings(log, assessment.full, assessment.rows)
    findings += assessment.findings + converter_findings(log) + _error_velocity_findings(log, assessment)
    depth, mounting, others = _against_reference(log, assessment, whole, mounted, reference, imu, depths)
    attitude = own_attitude if reference is None else reference
    agreement = None
    if water is not None and stated is not None and log.beams and attitude is not None:
        agreement = water_agreement(log, whole, water, stated, attitude)
    others += water_findings(agreement)
    found = ranked(findings + others)
    return Audit(log, same, assessment, depth, mounting, found, geometry_name, directions, agreement)


def _error_velocity_findings(log: BeamLog, assessment: BeamAssessment) -> list[Finding]:
    """Closure findings of an instrument that records its error velocity in place of the beams."""
    error = log.error_velocity_mps
    if error is None or log.beams or np.isfinite(error).sum() < LEAST_PINGS:
        return []
    closure = closure_of(np.ones(1), error[np.isfinite(error)][:, None])
    assessment.closures.append(closure)
    return closure_findings(closure)


def _against_reference(
    log: BeamLog,
    assessment: BeamAssessment,
    whole: NDArray[np.bool_],
    mounted: Mounted,
    reference: Reference | None,
    imu: Inertial | None,
    depths: Depths | None,
) -> tuple[DepthRate | None, Mounting | None, list[Finding]]:
    """Depth rate and mounting of the velocity against the other recordings, with their findings."""
    depth, mounting, findings = None, None, []
    velocity, known = _velocity(log, assessment, whole)
    if not known.any() or not log.own_frame:
        return None, None, []
    rows = _rising(log.time_ns, known)
    if depths is not None:
        depth = depth_rate(log.time_ns[rows], velocity[rows], depths, reference)
        findings += depth_findings(depth)
    if reference is not None:
        mounting = find_mounting(log.time_ns[rows], velocity[rows], reference, imu)
        findings += mounting_findings(mounting, mounted)
    return depth, mounting, findings


def converter_findings(log: BeamLog) -> list[Finding]:
    """Records that the reader skipped or flagged, from the account beside the table."""
    found = []
    for fate, text in (("skipped", "gave no row"), ("flagged", "were kept with a change")):
        reasons = log.beside.get(fate, {})
        read = float(log.beside.get("records_read", 0) or 1)
        for name, reason in (reasons if isinstance(reasons, dict) else {}).items():
            count = int(reason["count"])
            found.append(
                Finding(
                    f"reader_{fate}", "note", min(count / read, 1.0),
                    f"{count} of {read:.0f} records of the recording {text}: {name}.",
                    f"First: {', '.join(f'{k} {v}' for k, v in reason.items() if k != 'count')}.",
                    "See the account (JSON) beside the table.",
                    size=float(count), unit="records",
                )
            )  # fmt: skip
    return found


def _velocity(
    log: BeamLog, assessment: BeamAssessment, whole: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Velocity (n, 3), DVL frame, and its validity (n,): the instrument's own, else least squares of full pings."""
    if log.instrument_mps is not None:
        solved = log.solved
        return log.instrument_mps, solved & whole if log.beams and (solved & whole).sum() > 100 else solved
    if assessment.rows is None:
        return np.zeros((log.pings, 3)), np.zeros(log.pings, dtype=bool)
    return np.asarray(log.velocity_mps @ np.linalg.pinv(assessment.rows).T), whole


def _rising(time_ns: NDArray[np.int64], chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Rows of the chosen pings with a time later than all before; repeats and steps back have their own findings."""
    rows = np.flatnonzero(chosen)
    return np.asarray(rows[rising(time_ns[rows])])


def audit_file(
    path: str | Path,
    *,
    geometry: str | Path | None = None,
    reference: Reference | None = None,
    imu: Inertial | None = None,
    depths: Depths | None = None,
) -> Audit:
    """Reads and audits a log, with the table of its water where one stands beside it.

    Args:
        path: a beam table (CSV or Parquet), or a log whose columns the geometry file maps.
        geometry: TOML file or packaged name to compare with.
        reference, imu, depths: other recordings of the same time.

    Raises:
        DataError: for a log that cannot be read or does not fit the geometry.
        ScenarioError: for a geometry file with a fault.
    """
    instrument = None if geometry is None else read_geometry(geometry)
    log = read_log(path, None if instrument is None else instrument.columns)
    water = water_file(path)
    return audit_log(
        log,
        stated=None if instrument is None else instrument.geometry,
        geometry_name=None if geometry is None else str(geometry),
        mounting_rpy_rad=np.zeros(3) if instrument is None else instrument.mounting_rpy_rad,
        reference=reference, imu=imu, depths=depths,
        water=read_water_table(water) if water.is_file() else None,
        own_attitude=read_own_attitude(path) if water.is_file() else None,
    )  # fmt: skip


_OF_MATRIX = (
    "directions", "direction_sd_rad", "tilt_rad", "tilt_sd_rad", "azimuth_rad", "azimuth_sd_rad", "scale", "scale_sd",
    "bias_mps", "bias_sd_mps", "residual_mps", "excitation_mps", "regression", "pings", "observable",
)  # fmt: skip


def _closure_numbers(closure: Closure) -> dict[str, Any]:
    kept = {key: value for key, value in vars(closure).items() if key != "values_mps"}
    return dict(plain(kept | {"beam_sigma_mps": closure.beam_sigma_mps}))


def numbers_of(audit: Audit) -> dict[str, Any]:
    """All results in the types of JSON, in SI units and radians."""
    log, assessment = audit.log, audit.assessment
    content: dict[str, Any] = {
        "log": log.place,
        "geometry": audit.geometry_name,
        "pings": log.pings,
        "beams": log.beams,
        "duration_s": float(log.time_s.max()),
        "pings_by_valid_beams": {
            str(k): int(np.sum(log.valid.sum(axis=1) == k)) for k in range(log.beams, -1, -1)
        },
        "full_pings_used": int(assessment.full.sum()),
        "unchanged_pings": int(audit.unchanged.sum()),
        "findings": [plain(vars(one)) for one in audit.findings],
        "converted": plain(log.beside),
        "matrix": None,
        "match": None,
        "closure": [_closure_numbers(one) for one in assessment.closures],
        "closure_slope": None,
        "depth_rate": None if audit.depth is None else plain(vars(audit.depth)),
        "mounting": None if audit.mounting is None else plain(vars(audit.mounting)),
        "water": None if audit.water is None else plain(vars(audit.water)),
    }  # fmt: skip
    if assessment.matrix is not None:
        m = assessment.matrix
        content["matrix"] = plain({name: getattr(m, name) for name in _OF_MATRIX})
    if assessment.match is not None:
        one = assessment.match
        content["match"] = plain(
            {
                "beam": one.beam + 1,
                "sign": one.sign,
                "off_rad": one.off_rad,
                "rotation_rad": one.rotation.as_rotvec(),
            }
        )
    if assessment.slope is not None:
        content["closure_slope"] = plain(vars(assessment.slope) | {"p_value": assessment.slope.p_value})
    return content
