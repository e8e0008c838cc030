"""Checks against what stands beside a log: depth, water, mounting, IMU."""

from collections.abc import Iterator

import numpy as np

from bottomlock.audit.context import Context
from bottomlock.audit.depth import WINDOW_S
from bottomlock.audit.findings import finding, listed
from bottomlock.audit.logs import AXES, BeamLog
from bottomlock.audit.mounting import PARTS, Mounting
from bottomlock.audit.robust import significant
from bottomlock.recordings.axes import from_angles
from bottomlock.recordings.finding import Finding, Severity


def another_time(log: BeamLog, context: Context) -> Iterator[Finding]:
    """Recordings that have no time in common with the log, of which nothing can be said."""
    for what, other in (("attitude", context.reference), ("IMU", context.imu), ("depth", context.depths)):
        if other is None or ((other.time_ns >= log.time_ns[0]) & (other.time_ns <= log.time_ns[-1])).any():
            continue
        first, last = (f"{times[0]} to {times[-1]}" for times in (log.time_ns, other.time_ns))
        size = 1e-9 * float(other.time_ns[0] - log.time_ns[0])
        yield finding("another_time", size, told={"what": what, "log": first, "other": last})


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
    told = {"basis": basis}
    if abs(rate.correlation) < 0.3 or not significant(rate.slope, rate.slope_sd, rate.blocks, 0.0):
        yield finding("depth_not_observable", rate.slope, 0.0, told, sd=rate.slope_sd)
    elif rate.slope < 0.0:
        yield finding("z_points_up", rate.slope, told=told, sd=rate.slope_sd)
    elif rate.levelled and significant(rate.slope - 1.0, rate.slope_sd, rate.blocks, 0.03):
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
    rates = listed(np.rad2deg(m.rate_rms_radps), ".2g")
    return (
        f"From {m.source}, {m.instants} instants; residual {listed(1e3 * m.residual_mps, '.0f')} mm/s; "
        f"{100.0 * m.explained:.0f} % of the {what} explained; rates {rates} deg/s RMS."
    )


def mounting(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Other recordings that do not explain the velocity, or only with a left-handed frame."""
    m = context.mounting
    if m is not None and not m.follows:
        yield finding("mounting_not_observable", m.explained, 0.0, {"basis": _basis(m)})
    elif m is not None and m.mirrored:
        yield finding("left_handed", told={"basis": _basis(m)})


def parts(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Mounting angles, lever arm, clock and scale other than stated, or not observable."""
    m = context.mounting
    if m is None or not m.follows:
        return
    turn = from_angles(*m.rpy_rad) * from_angles(*context.stated_rpy_rad).inv()
    stated = {"misalignment": context.stated_rpy_rad, "lever_arm": context.stated_lever_arm_m}
    for kind, part in PARTS.items():
        value, sd = m.told(part)
        meant = stated.get(kind, np.zeros(len(value)))
        # Angles are compared about the platform's axes, as their standard deviations are.
        off = turn.as_rotvec() if kind == "misalignment" else value - meant
        sure = significant(off, sd, m.blocks, part.least)
        unseen = ~sure & (sd > part.limit)
        each = zip(part.names, part.factor * value, part.factor * sd, unseen, strict=True)
        listed_parts = [
            f"{name} not observable" if blind else f"{name} {format(one, part.form)} ± {spread:.2g}".strip()
            for name, one, spread, blind in each
        ]
        told = {
            "what": part.what, "listed": ", ".join(listed_parts), "unit": part.unit, "lacks": part.lacks,
            "stated": listed(part.factor * meant), "sds": listed(part.factor * sd, ".2g"), "basis": _basis(m),
        }  # fmt: skip
        if sure.any():
            size = float(np.linalg.norm(off[sure])) if len(off) > 1 else float(off[0])
            weight = abs(size) * (float(np.linalg.norm(m.rate_rms_radps)) if kind == "lever_arm" else 1.0)
            yield finding(
                kind, part.factor * size, min(weight, 1.0), told, sd=float(part.factor * np.linalg.norm(sd[sure])),
                severity="fault" if abs(size) > part.fault else "warning",
            )  # fmt: skip
        elif unseen.any():
            names = " ".join(part.names[k] for k in np.flatnonzero(unseen)).strip()
            told["names"] = names and f": {names.replace(' ', ', ')}"
            yield finding("not_observable", 0.0, 0.0, told)


def imu(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Axes and clock of an IMU other than the attitude's."""
    m = context.mounting
    aligned = m.imu if m is not None and m.follows else None
    if aligned is None or not aligned.seen:
        return
    diagonal = np.diag(aligned.matrix)
    axes = [AXES[k] for k in np.flatnonzero(diagonal < -0.5)]
    if axes:
        left = " (its frame is left-handed)" if np.linalg.det(aligned.matrix) < 0.0 else ""
        told = {"axes": " and ".join(axes), "left": left, "diagonal": listed(diagonal, "+.3f")}
        yield finding("imu_axes", len(axes), told=told)
    offset, sd = aligned.offset_s, aligned.offset_sd_s
    if sd < 0.05 and significant(offset, sd, aligned.blocks, 0.01):
        yield finding("imu_clock_offset", offset, min(abs(offset), 1.0), sd=sd)
