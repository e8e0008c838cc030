"""Checks against the reference that stands beside a log: its time, and the mounting by it."""

from collections.abc import Iterator

import numpy as np

from bottomlock.audit.context import Context
from bottomlock.audit.findings import finding, listed
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.mounting import PARTS, SOURCE, Mounting
from bottomlock.audit.robust import significant
from bottomlock.recordings.axes import from_angles
from bottomlock.recordings.finding import Finding


def another_time(log: BeamLog, context: Context) -> Iterator[Finding]:
    """A reference that has no time in common with the log, of which nothing can be said."""
    other = context.reference
    if other is not None and not other.spans(log.time_ns).any():
        first, last = (f"{times[0]} to {times[-1]}" for times in (log.time_ns, other.time_ns))
        yield finding(
            "another_time",
            1e-9 * float(other.time_ns[0] - log.time_ns[0]),
            told={"log": first, "other": last},
        )


def _basis(m: Mounting) -> str:
    rates = listed(np.rad2deg(m.rate_rms_radps), ".2g")
    return (
        f"From {SOURCE}, {m.instants} instants; residual {listed(1e3 * m.residual_mps, '.0f')} mm/s; "
        f"{100.0 * m.explained:.0f} % of the motion explained; rates {rates} deg/s RMS."
    )


def mounting(_: BeamLog, context: Context) -> Iterator[Finding]:
    """A reference that does not explain the velocity, or only with a left-handed frame."""
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
