"""Which packaged geometry a log shows, where the stated one is wrong or none is stated."""

import numpy as np

from bottomlock.audit.beam_order import closure_size
from bottomlock.audit.beams import BeamAssessment, assess_beams
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS
from bottomlock.audit.robust import Array
from bottomlock.io.beams import packaged_geometries, read_geometry
from bottomlock.recordings.finding import Finding

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
    closures = {one: 1e3 * closure_size(readings, rows) for one, rows in named.items()}
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
