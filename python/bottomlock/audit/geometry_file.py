"""The geometry file that an audit writes, as `bottomlock fix` and `read_geometry` read it."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bottomlock.audit.logs import Array
from bottomlock.audit.matrix import LEAST_PINGS, azimuth, tilt
from bottomlock.audit.mounting import SOURCE, Mounting
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
    log, rows, matrix, m = audit.log, audit.beams.rows, audit.beams.seen, audit.mounting
    if rows is None:
        why, hint = "beams alone leave 9 of 12 entries free", "state the geometry with --geometry"
        raise _refusal(audit, why if log.beams else "it has no beams", hint=hint if log.beams else "")
    if audit.beams.ambiguous:
        raise _refusal(audit, "closure cannot distinguish the orders that close, and the stated one does not")
    how = f"as stated by {audit.geometry_name}, order and signs by closure"
    sds, lines = [""] * len(rows), []
    if matrix is not None:
        how = f"from {matrix.pings} full pings ({matrix.regression})"
        sds = [f" ± {sd:.2g}" for sd in np.rad2deg(matrix.direction_sd_rad)]
        common, alike = float(np.mean(matrix.scale)), float(np.ptp(matrix.scale)) < 0.01
        if alike and abs(common - 1.0) > max(0.005, SURE * float(np.mean(matrix.scale_sd))):
            lines = [f"sound_speed_scale = {common:.6f}  # the beams read this times what the velocity says"]
    lines.append(f"beam_noise_mps = {_noise(audit):.4g}  # m/s per beam, 1 sigma, robust")
    if m is not None and m.knows("misalignment"):
        angles = zip(
            ANGLES, np.rad2deg(m.values["misalignment"]), np.rad2deg(m.sds["misalignment"]), strict=True
        )
        lines += [f"mounting_{name}_deg = {value:.4f}  # ± {sd:.2g}" for name, value, sd in angles]
    if m is not None and m.knows("lever_arm"):
        arms = ", ".join([_vector(m.values["lever_arm"], 4)] * log.beams)
        sd = ", ".join(f"{one:.2g}" for one in m.sds["lever_arm"])
        lines.append(f"lever_arms_m = [{arms}]  # of the instrument as a whole, ± {sd} m")
    if log.columns is not None and log.columns.velocity is not None:
        lines += ["", "[columns]"]
        for key, value in log.columns.model_dump(exclude_defaults=True).items():
            lines.append(f"{key} = {json.dumps(list(value) if isinstance(value, tuple) else value)}")
    angles_deg = np.rad2deg(np.stack([tilt(rows), azimuth(rows)], axis=1))
    units = rows / np.linalg.norm(rows, axis=1)[:, None]
    directions = [
        f"    {_vector(units[k], 9)},  # beam {k + 1}: tilt {one:.3f}, azimuth {other:.3f} deg{sds[k]}"
        for k, (one, other) in enumerate(angles_deg)
    ]
    return "\n".join([
        f"# Found by `bottomlock audit`, {how}. Frame: that of the instrument's velocity.",
        f"name = {json.dumps(f'audit of {log.place}')}", 'configuration = "directions"',
        "directions = [  # unit vectors along which a reading is positive, in the order of the log",
        *directions, "]", *lines, *calibration_lines(known(m, log.place)), "",
    ])  # fmt: skip


def _refusal(audit: Audit, why: str, *, expected: str = "", hint: str = "") -> DataError:
    what = f"no geometry can be written: {why}"
    return DataError(what, place=audit.log.place, expected=expected, hint=hint)


def _vector(values: Sequence[float] | Array, digits: int) -> str:
    return "[" + ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values) + "]"


def _noise(audit: Audit) -> float:
    """Beam noise, m/s, from the closure; without one from second differences in time, which include some motion.

    Rounding to the format's resolution alone makes a noise, of a twelfth of its square in variance.
    """
    log, readings = audit.log, audit.log.velocity_mps[audit.whole]
    if len(readings) < LEAST_PINGS:
        expected = f"{LEAST_PINGS} or more to measure the beam noise"
        raise _refusal(audit, f"{len(readings)} full pings", expected=expected, hint="record longer")
    if audit.closures:
        found = float(np.median([one.beam_sigma_mps for one in audit.closures]))
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
    found = Calibrated(f"audit of {place}, from {SOURCE}", None, None, None, None, None, None)
    if m is not None and m.knows("misalignment"):
        found = replace(found, mounting_sd_rad=m.sds["misalignment"])
    if m is not None and m.knows("velocity_scale"):
        value, sd = float(m.values["velocity_scale"][0]), float(m.sds["velocity_scale"][0])
        found = replace(found, scale=value, scale_sd=sd)
    if m is not None and m.knows("clock_offset"):
        value, sd = float(m.values["clock_offset"][0]), float(m.sds["clock_offset"][0])
        found = replace(found, clock_offset_s=value, clock_sd_s=sd)
    return found
