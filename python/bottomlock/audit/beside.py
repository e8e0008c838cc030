"""Checks against what stands beside a log: depth, water, mounting, IMU."""

from collections.abc import Iterator

import numpy as np

from bottomlock.audit.context import Context
from bottomlock.audit.depth import WINDOW_S
from bottomlock.audit.findings import Told, finding, listed
from bottomlock.audit.logs import AXES, BeamLog
from bottomlock.audit.mounting import LIMITS, Mounting
from bottomlock.audit.robust import sigmas_for
from bottomlock.recordings.finding import Finding, Severity

ANGLES = ("roll", "pitch", "yaw")


def depth(_: BeamLog, context: Context) -> Iterator[Finding]:
    """A z axis that points up, or a wrong vertical scale."""
    rate = context.depth
    if rate is None:
        return
    caveat = (
        "" if rate.levelled else " Without an attitude, pitch times surge is included and biases the slope."
    )
    basis = (
        f"Slope {rate.slope:+.2f} ± {rate.slope_sd:.2g}, correlation {rate.correlation:+.2f} over {rate.windows} "
        f"windows of {WINDOW_S:g} s ({rate.blocks} independent).{caveat}"
    )
    told, limit = {"basis": basis}, sigmas_for(rate.blocks) * rate.slope_sd
    if abs(rate.correlation) < 0.3 or abs(rate.slope) < limit:
        yield finding("depth_not_observable", rate.slope, 0.0, told, sd=rate.slope_sd)
    elif rate.slope < 0.0:
        yield finding("z_points_up", rate.slope, told=told, sd=rate.slope_sd)
    elif rate.levelled and abs(rate.slope - 1.0) > max(0.03, limit):
        size = rate.slope - 1.0
        yield finding("vertical_scale", 100.0 * size, min(abs(size), 1.0), told, sd=100.0 * rate.slope_sd)


def water(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Beams of the water with a wrong sign or scale."""
    found = context.water
    if found is not None and found.wrong:
        basis = (
            f"Factor {found.scale:.2f} ± {found.scale_sd:.2g} of the velocity through the water in cell {found.cell}, "
            f"{found.pings} pings; current north, east {listed(found.current_mps, '+.2f')} m/s."
        )
        severity: Severity = "fault" if found.scale < 0.0 else "warning"
        weight = min(abs(1.0 / found.scale - 1.0), 1.0)
        yield finding(
            "water_scale", found.scale, weight, {"basis": basis}, sd=found.scale_sd, severity=severity
        )


def _basis(m: Mounting) -> str:
    what = f"velocity changes (response {1.0 + m.scale:.2f} ± {m.scale_sd:.2g})" if m.of_changes else "motion"
    return (
        f"From {m.source}, {m.instants} instants; residual {listed(1e3 * m.residual_mps, '.0f')} mm/s; "
        f"{100.0 * m.explained:.0f} % of the {what} explained."
    )


def _followed(context: Context) -> Mounting | None:
    """The mounting, where the other recordings explain the velocity."""
    return context.mounting if context.mounting is not None and context.mounting.follows else None


def _unseen(what: str, sd: str, lacks: str) -> Finding:
    return finding("not_observable", 0.0, 0.0, {"what": what, "told": sd, "lacks": lacks})


def mounting(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Other recordings that do not explain the velocity, or only with a left-handed frame."""
    m = context.mounting
    if m is not None and not m.follows:
        yield finding("mounting_not_observable", m.explained, 0.0, {"basis": _basis(m)})
    elif m is not None and m.mirrored:
        yield finding("left_handed", told={"basis": _basis(m)})


def misalignment(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Mounting angles other than stated, about the platform's axes, as their standard deviations are."""
    m, stated = _followed(context), context.mounted
    if m is None:
        return
    off, sd = (m.rotation * stated.rotation.inv()).as_rotvec(), m.misalignment_sd_rad
    blind = sd > LIMITS["misalignment_rad"]
    for k in np.flatnonzero(blind):
        what = f"Misalignment about {AXES[k]} ({ANGLES[k]})"
        yield _unseen(what, f"{np.rad2deg(sd[k]):.2g} deg", "speed across that axis")
    sure = ~blind & (np.abs(off) > np.maximum(np.deg2rad(0.05), sigmas_for(m.blocks) * sd))
    if sure.any():
        size = float(np.rad2deg(np.linalg.norm(off[sure])))
        angles = zip(ANGLES, np.rad2deg(m.rpy_rad), np.rad2deg(sd), strict=True)
        told = {
            "listed": ", ".join(f"{name} {value:+.2f} ± {spread:.2g}" for name, value, spread in angles),
            "significant": ", ".join(ANGLES[k] for k in np.flatnonzero(sure)), "against": "the platform",
            "basis": _basis(m),
        }  # fmt: skip
        if stated.rpy_rad.any():
            told["against"] = f"the stated mounting ({listed(np.rad2deg(stated.rpy_rad))} deg)"
        weight, spread = np.sin(np.deg2rad(min(size, 90.0))), np.rad2deg(np.linalg.norm(sd[sure]))
        severity: Severity | None = "fault" if size > 1.0 else None
        yield finding("misalignment", size, weight, told, sd=spread, severity=severity)


def lever_arm(_: BeamLog, context: Context) -> Iterator[Finding]:
    """A lever arm other than stated."""
    m, stated = _followed(context), context.mounted.lever_arm_p_m
    if m is None:
        return
    arm, sd = m.lever_arm_p_m, m.lever_arm_sd_m
    sure = np.abs(arm - stated) > np.maximum(0.02, sigmas_for(m.blocks) * sd)
    seen = sure | (sd <= LIMITS["lever_arm_m"])
    rates = listed(np.rad2deg(m.rate_rms_radps), ".2g")
    if not seen.any():
        yield _unseen("The lever arm", f"{sd.min():.2g} m (rates {rates} deg/s RMS)", "rotations")
    elif sure.any():
        parts = [
            f"{axis} {arm[k]:+.2f} ± {sd[k]:.2g}" if seen[k] else f"{axis} not observable"
            for k, axis in enumerate(AXES)
        ]
        told = {
            "point": "the IMU" if m.of_changes else "the point of the reference velocity",
            "listed": ", ".join(parts), "basis": f"Rates {rates} deg/s RMS. {_basis(m)}",
            "against": f", stated is ({listed(stated)}) m" if stated.any() else "",
        }  # fmt: skip
        size = float(np.linalg.norm((arm - stated)[seen]))
        weight = min(float(size * np.linalg.norm(m.rate_rms_radps)), 1.0)
        yield finding("lever_arm", size, weight, told, sd=float(np.linalg.norm(sd[seen])))


def clock(_: BeamLog, context: Context) -> Iterator[Finding]:
    """A clock that differs from the reference's."""
    m = _followed(context)
    if m is None:
        return
    offset, sd = m.clock_offset_s, m.clock_offset_sd_s
    if sd > LIMITS["clock_offset_s"]:
        yield _unseen("The clock offset", f"{sd:.2g} s", "speed changes")
    elif abs(offset) > max(0.02, sigmas_for(m.blocks) * sd):
        yield finding("clock_offset", offset, min(abs(offset), 1.0), {"basis": _basis(m)}, sd=sd)


def scale(_: BeamLog, context: Context) -> Iterator[Finding]:
    """A scale of the velocity against the reference."""
    m = _followed(context)
    if m is None:
        return
    if abs(m.scale) > max(0.002, sigmas_for(m.blocks) * m.scale_sd):
        told: Told = {"basis": _basis(m)}
        yield finding("velocity_scale", 100.0 * m.scale, abs(m.scale), told, sd=100.0 * m.scale_sd)
    elif m.scale_sd > LIMITS["scale"]:
        yield _unseen("The scale", f"{100.0 * m.scale_sd:.2g} %", "speed")


def imu(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Axes and clock of an IMU other than the attitude's."""
    m = _followed(context)
    aligned = None if m is None else m.imu
    if aligned is None or not aligned.seen:
        return
    diagonal = np.diag(aligned.matrix)
    axes = [AXES[k] for k in np.flatnonzero(diagonal < -0.5)]
    if axes:
        left = " (its frame is left-handed)" if np.linalg.det(aligned.matrix) < 0.0 else ""
        told = {"axes": " and ".join(axes), "left": left, "diagonal": listed(diagonal, "+.3f")}
        yield finding("imu_axes", len(axes), told=told)
    offset, sd = aligned.offset_s, aligned.offset_sd_s
    if sd < 0.05 and abs(offset) > max(0.01, sigmas_for(aligned.blocks) * sd):
        yield finding("imu_clock_offset", offset, min(abs(offset), 1.0), sd=sd)
