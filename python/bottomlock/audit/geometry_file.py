"""The geometry file that an audit writes: what `bottomlock fix` and `read_geometry` take."""

import json
from collections.abc import Sequence

import numpy as np

from bottomlock.audit.matrix import azimuth, tilt
from bottomlock.audit.mounting import LIMITS
from bottomlock.audit.robust import Array, sigma
from bottomlock.audit.run import Audit
from bottomlock.errors import DataError

SURE = 5.0


def geometry_text(audit: Audit) -> str:
    """The TOML of the found geometry: directions in the order and signs of the log, noise, scale, mounting, lever arm.

    Raises:
        DataError: where the log gives no directions (no beams; or neither a velocity beside them nor a stated
            geometry).
    """
    log, verdict = audit.log, audit.verdict
    if verdict.rows is None:
        why = (
            "it has no beams"
            if not log.beams
            else "beams alone leave 9 of 12 numbers free; state a geometry with --geometry"
        )
        raise DataError(f"{log.place}: no geometry can be written: {why}")
    if verdict.ambiguous:
        raise DataError(
            f"{log.place}: no geometry can be written: the stated order does not close, and closure cannot choose "
            "between others; state the right one with --geometry"
        )
    length = np.linalg.norm(verdict.rows, axis=1)
    unit = verdict.rows / length[:, None]
    found = verdict.matrix is not None and bool(verdict.matrix.observable.all())
    source = (
        f"from {verdict.matrix.pings} full pings ({verdict.matrix.way})"
        if found and verdict.matrix is not None
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
            if not found or verdict.matrix is None
            else f" ± {np.rad2deg(verdict.matrix.direction_sd_rad[k]):.2g}"
        )
        told = f"tilt {np.rad2deg(tilt(row)):.3f}, azimuth {np.rad2deg(azimuth(row)):.3f} deg{sd}"
        lines.append(f"    {_vector(row, 9)},  # beam {k + 1}: {told}")
    lines.append("]")
    if verdict.matrix is not None and found:
        m = verdict.matrix
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
    return "\n".join(lines) + "\n"


def _vector(values: Sequence[float] | Array, digits: int) -> str:
    return "[" + ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + "]"


def _noise(audit: Audit) -> float:
    """Of the closure, where there is one; of second differences in time else, which holds some motion."""
    if audit.verdict.closures:
        return max(float(np.median([one.beam_sigma_mps for one in audit.verdict.closures])), 1e-6)
    readings = audit.log.velocity_mps[audit.verdict.full]
    if len(readings) < 3:
        raise DataError(
            f"{audit.log.place}: no geometry can be written: too few full pings to tell the beam noise"
        )
    bent = np.diff(readings, n=2, axis=0) / np.sqrt(6.0)
    return max(float(np.mean([sigma(column) for column in bent.T])), 1e-6)


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
