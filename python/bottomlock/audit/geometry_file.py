"""The geometry file that an audit writes, as `bottomlock fix` and `read_geometry` read it."""

import json
import math
from collections.abc import Sequence

import numpy as np

from bottomlock.audit.matrix import LEAST_PINGS, azimuth, tilt
from bottomlock.audit.mounting import SOURCE, Mounting
from bottomlock.audit.robust import Array
from bottomlock.audit.run import Audit
from bottomlock.errors import DataError
from bottomlock.io.calibrated_file import ANGLES, Calibrated, calibration_lines
from bottomlock.recordings.robust import white_sd

SURE = 5.0
LEAST_NOISE_MPS = 1e-5
"""A hundredth of the mm/s that most instruments write: no echo is measured so well."""


def geometry_text(audit: Audit) -> str:
    """TOML of the estimated geometry: directions in the order and signs of the log, noise, scale, mounting, lever arm.

    Raises:
        DataError: where the log gives no directions (no beams; neither a velocity nor a stated geometry; an ambiguous
            order), or too few full pings for the beam noise.
    """
    log, found = audit.log, audit.assessment
    rows, matrix = found.rows, found.matrix if found.seen else None
    if rows is None or found.ambiguous:
        why = "closure cannot distinguish the orders that close, and the stated one does not"
        if rows is None:
            why = "beams alone leave 9 of 12 entries free" if log.beams else "it has no beams"
        raise _refusal(audit, why, hint="state the geometry with --geometry" if log.beams else "")
    how = f"as stated by {audit.geometry_name}, order and signs by closure"
    sds, scale = [""] * len(rows), []
    if matrix is not None:
        how = f"from {matrix.pings} full pings ({matrix.regression})"
        sds = [f" ± {sd:.2g}" for sd in np.rad2deg(matrix.direction_sd_rad)]
        common, alike = float(np.mean(matrix.scale)), float(np.ptp(matrix.scale)) < 0.01
        if alike and abs(common - 1.0) > max(0.005, SURE * float(np.mean(matrix.scale_sd))):
            scale = [f"sound_speed_scale = {common:.6f}  # the beams read this times what the velocity says"]
    lines = [
        f"# Found by `bottomlock audit`, {how}. Frame: that of the instrument's velocity.",
        f"name = {json.dumps(f'audit of {log.place}')}",
        'configuration = "directions"',
        "directions = [  # unit vectors along which a reading is positive, in the order of the log",
    ]
    for k, row in enumerate(rows / np.linalg.norm(rows, axis=1)[:, None]):
        angles = f"tilt {np.rad2deg(tilt(row)):.3f}, azimuth {np.rad2deg(azimuth(row)):.3f} deg{sds[k]}"
        lines.append(f"    {_vector(row, 9)},  # beam {k + 1}: {angles}")
    noise = f"beam_noise_mps = {_noise(audit):.4g}  # m/s per beam, 1 sigma, robust"
    lines += ["]", *scale, noise, *_mounting_lines(audit.mounting, log.beams)]
    if log.columns is not None and log.columns.velocity is not None:
        lines += ["", "[columns]"]
        for key, value in log.columns.model_dump(exclude_defaults=True).items():
            lines.append(f"{key} = {json.dumps(list(value) if isinstance(value, tuple) else value)}")
    return "\n".join([*lines, *calibration_lines(known(audit.mounting, log.place))]) + "\n"


def _refusal(audit: Audit, why: str, *, expected: str = "", hint: str = "") -> DataError:
    return DataError(
        f"no geometry can be written: {why}", place=audit.log.place, expected=expected, hint=hint
    )


def _vector(values: Sequence[float] | Array, digits: int) -> str:
    return "[" + ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + "]"


def _noise(audit: Audit) -> float:
    """Beam noise, m/s, from the closure; without one from second differences in time, which include some motion.

    Rounding to the format's resolution alone makes a noise, of a twelfth of its square in variance.
    """
    log, readings = audit.log, audit.log.velocity_mps[audit.assessment.full]
    if len(readings) < LEAST_PINGS:
        expected = f"{LEAST_PINGS} or more to measure the beam noise"
        raise _refusal(audit, f"{len(readings)} full pings", expected=expected, hint="record longer")
    if audit.assessment.closures:
        found = float(np.median([one.beam_sigma_mps for one in audit.assessment.closures]))
    else:
        found = float(np.mean(white_sd(readings, 2)))
    resolution = log.beside.get("resolution_mps", 0.0)
    noise = max(found, resolution / math.sqrt(12.0) if isinstance(resolution, float) else 0.0)
    if not noise > LEAST_NOISE_MPS:
        why = f"the {len(readings)} full pings show a beam noise of {noise:.1g} m/s"
        hint = "are the beams computed from a velocity?"
        raise _refusal(audit, why, expected=f"more than {LEAST_NOISE_MPS:g}", hint=hint)
    return noise


def known(m: Mounting | None, place: str) -> Calibrated:
    """What is known of mounting, scale and clock, which a replay takes as its prior; nothing of what is not seen."""
    turn, scale, clock = (
        m is not None and m.knows(kind) for kind in ("misalignment", "velocity_scale", "clock_offset")
    )
    if m is None or not (turn or scale or clock):
        return Calibrated("", None, None, None, None, None, None)
    return Calibrated(
        source=f"audit of {place}, from {SOURCE}",
        mounting_rpy_rad=None,
        mounting_sd_rad=m.misalignment_sd_rad if turn else None,
        scale=m.scale if scale else None,
        scale_sd=m.scale_sd if scale else None,
        clock_offset_s=m.clock_offset_s if clock else None,
        clock_sd_s=m.clock_offset_sd_s if clock else None,
    )


def _mounting_lines(m: Mounting | None, beams: int) -> list[str]:
    lines = []
    if m is not None and m.knows("misalignment"):
        for name, value, sd in zip(
            ANGLES, np.rad2deg(m.rpy_rad), np.rad2deg(m.misalignment_sd_rad), strict=True
        ):
            lines.append(f"mounting_{name}_deg = {value:.4f}  # ± {sd:.2g}")
    if m is not None and m.knows("lever_arm"):
        arms, sd = (
            ", ".join([_vector(m.lever_arm_p_m, 4)] * beams),
            ", ".join(f"{one:.2g}" for one in m.lever_arm_sd_m),
        )
        lines.append(f"lever_arms_m = [{arms}]  # of the instrument as a whole, ± {sd} m")
    return lines
