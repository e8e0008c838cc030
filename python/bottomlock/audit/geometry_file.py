"""The geometry file that an audit writes, as `bottomlock fix` and `read_geometry` read it."""

import json
import math
from collections.abc import Sequence

import numpy as np

from bottomlock.audit.matrix import LEAST_PINGS, azimuth, tilt
from bottomlock.audit.mounting import LIMITS, Mounting
from bottomlock.audit.robust import Array
from bottomlock.audit.run import Audit
from bottomlock.errors import DataError
from bottomlock.io.calibrated_file import Calibrated, calibration_lines
from bottomlock.recordings.robust import sd_about_median

SURE = 5.0
LEAST_NOISE_MPS = 1e-5
"""A hundredth of the mm/s that most instruments write: no echo is measured so well."""


def geometry_text(audit: Audit) -> str:
    """TOML of the estimated geometry: directions in the order and signs of the log, noise, scale, mounting, lever arm.

    Raises:
        DataError: where the log gives no directions (no beams; neither a velocity nor a stated geometry; an ambiguous
            order), or too few full pings for the beam noise.
    """
    log, assessment = audit.log, audit.assessment
    if assessment.rows is None:
        why = (
            "it has no beams"
            if not log.beams
            else "beams alone leave 9 of 12 entries free; state a geometry with --geometry"
        )
        raise DataError(f"no geometry can be written: {why}", place=log.place)
    if assessment.ambiguous:
        raise DataError(
            (
                "no geometry can be written: the stated order does not close, and closure cannot "
                "distinguish the orders that do"
            ),
            place=log.place,
            hint="state the right one with --geometry",
        )
    length = np.linalg.norm(assessment.rows, axis=1)
    unit = assessment.rows / length[:, None]
    found = assessment.matrix is not None and bool(assessment.matrix.observable.all())
    source = (
        f"from {assessment.matrix.pings} full pings ({assessment.matrix.regression})"
        if found and assessment.matrix is not None
        else f"as stated by {audit.geometry_name}, order and signs by closure"
    )
    lines = [
        f"# Found by `bottomlock audit`, {source}. Frame: that of the instrument's velocity.",
        f"name = {json.dumps(f'audit of {log.place}')}",
        'configuration = "directions"',
        "directions = [  # unit vectors along which a reading is positive, in the order of the log",
    ]
    for k, row in enumerate(unit):
        sd = (
            ""
            if not found or assessment.matrix is None
            else f" ± {np.rad2deg(assessment.matrix.direction_sd_rad[k]):.2g}"
        )
        angles = f"tilt {np.rad2deg(tilt(row)):.3f}, azimuth {np.rad2deg(azimuth(row)):.3f} deg{sd}"
        lines.append(f"    {_vector(row, 9)},  # beam {k + 1}: {angles}")
    lines.append("]")
    if assessment.matrix is not None and found:
        m = assessment.matrix
        common = float(np.mean(m.scale))
        alike = float(np.ptp(m.scale)) < 0.01
        if alike and abs(common - 1.0) > max(0.005, SURE * float(np.mean(m.scale_sd))):
            lines.append(
                f"sound_speed_scale = {common:.6f}  # the beams read this times what the velocity says"
            )
    lines.append(f"beam_noise_mps = {_noise(audit):.4g}  # m/s per beam, 1 sigma, robust")
    lines += _mounting_lines(audit)
    if log.columns is not None and log.columns.velocity is not None:
        lines += ["", "[columns]"]
        for key, value in log.columns.model_dump(exclude_defaults=True).items():
            lines.append(f"{key} = {json.dumps(list(value) if isinstance(value, tuple) else value)}")
    lines += calibration_lines(known(audit.mounting, log.place))
    return "\n".join(lines) + "\n"


def _vector(values: Sequence[float] | Array, digits: int) -> str:
    return "[" + ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + "]"


def _noise(audit: Audit) -> float:
    """Beam noise, m/s, from the closure; without one from second differences in time, which include some motion.

    Rounding to the format's resolution alone makes a noise, of a twelfth of its square in variance.
    """
    log, readings = audit.log, audit.log.velocity_mps[audit.assessment.full]
    refusal = f"{log.place}: no geometry can be written:"
    if len(readings) < LEAST_PINGS:
        raise DataError(
            f"{refusal} {len(readings)} full pings",
            expected=f"{LEAST_PINGS} or more to measure the beam noise",
            hint="record longer",
        )
    if audit.assessment.closures:
        found = float(np.median([one.beam_sigma_mps for one in audit.assessment.closures]))
    else:
        bent = np.diff(readings, n=2, axis=0) / np.sqrt(6.0)
        found = float(np.mean(sd_about_median(bent, axis=0)))
    resolution = log.beside.get("resolution_mps", 0.0)
    noise = max(found, resolution / math.sqrt(12.0) if isinstance(resolution, float) else 0.0)
    if not noise > LEAST_NOISE_MPS:
        raise DataError(
            f"{refusal} the {len(readings)} full pings show a beam noise of {noise:.1g} m/s",
            expected=f"more than {LEAST_NOISE_MPS:g}",
            hint="are the beams computed from a velocity?",
        )
    return noise


def known(mounting: Mounting | None, place: str) -> Calibrated:
    """What is known of mounting, scale and clock, which a replay takes as its prior; nothing of what is not seen."""
    m = mounting
    if m is None or not m.follows or m.mirrored:
        return Calibrated("", None, None, None, None, None, None)
    has_mounting = bool((m.misalignment_sd_rad < LIMITS["misalignment_rad"]).all())
    has_scale, has_clock = m.scale_sd < LIMITS["scale"], m.clock_offset_sd_s < LIMITS["clock_offset_s"]
    return Calibrated(
        source=f"audit of {place}, from {m.source}",
        mounting_rpy_rad=None,
        mounting_sd_rad=m.misalignment_sd_rad if has_mounting else None,
        scale=m.scale if has_scale else None,
        scale_sd=m.scale_sd if has_scale else None,
        clock_offset_s=m.clock_offset_s if has_clock else None,
        clock_sd_s=m.clock_offset_sd_s if has_clock else None,
    )


def _mounting_lines(audit: Audit) -> list[str]:
    m = audit.mounting
    if m is None or not m.follows or m.mirrored:
        return []
    lines = []
    if (m.misalignment_sd_rad < LIMITS["misalignment_rad"]).all():
        for name, value, sd in zip(("roll", "pitch", "yaw"), m.rpy_rad, m.misalignment_sd_rad, strict=True):
            lines.append(f"mounting_{name}_deg = {np.rad2deg(value):.4f}  # ± {np.rad2deg(sd):.2g}")
    if (m.lever_arm_sd_m < LIMITS["lever_arm_m"]).all():
        arms = ", ".join([_vector(m.lever_arm_p_m, 4)] * audit.log.beams)
        sd = ", ".join(f"{value:.2g}" for value in m.lever_arm_sd_m)
        lines.append(f"lever_arms_m = [{arms}]  # of the instrument as a whole, ± {sd} m")
    return lines
