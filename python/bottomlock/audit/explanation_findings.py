"""Findings from the explanations of a beam matrix, and what of them is observable."""

import numpy as np

from bottomlock.audit.explanations import Explanation
from bottomlock.audit.findings import MATERIAL_RAD, MATERIAL_SCALE
from bottomlock.audit.matrix import Matrix, tilt
from bottomlock.audit.robust import sigmas_for
from bottomlock.recordings.finding import Finding, Severity

PROBABLE = 0.01
"""Explanations with a smaller share are not listed."""

_WHERE = {
    "used": "the instrument solves with this beam changed",
    "recorded": "the channel was changed after the instrument solved its velocity",
    "unknown": "the instrument solves without knowing of it",
}


def sure(one: Explanation, matrix: Matrix) -> bool:
    """The size of an explanation is significant, and matters."""
    angle = one.kind in {"tilt", "rotation", "beam_direction"}
    return abs(one.size) > max(
        MATERIAL_RAD if angle else MATERIAL_SCALE, sigmas_for(matrix.blocks) * one.size_sd
    )


def explanation_findings(explained: list[Explanation], matrix: Matrix, *, stated: bool) -> list[Finding]:
    """One finding for the most probable explanation, with the others that the log leaves open."""
    best = explained[0]
    others = [
        one
        for one in explained[1:]
        if one.share > PROBABLE and one.kind != "free" and (one.kind, one.beam) != (best.kind, best.beam)
    ]
    open_ = "; ".join(f"{_words(one)} (share {one.share:.2g})" for one in others[:4])
    against = "" if stated else " of a Janus"
    evidence = (
        f"Share {best.share:.3g} of the explanations tried"
        f"{f'; {_WHERE[best.where]}' if best.beam >= 0 else ''}. "
        f"{f'Also possible: {open_}. ' if open_ else ''}From {matrix.pings} pings; residual chi-squared "
        f"{best.chi2:.3g} for {best.free} numbers."
    )
    severity: Severity = "fault" if stated else "warning"
    if best.kind == "beam_scale":
        return [
            Finding(
                "beam_scale", severity, min(abs(best.size), 1.0),
                f"Beam {best.beam + 1} reads {100.0 * best.size:+.2f} % against the other beams{against}.",
                f"± {100.0 * best.size_sd:.1g} %. {evidence}",
                "Divide the channel by this, or correct where it is scaled; a fault of the transducer shows in the "
                "closure alone.",
                size=100.0 * abs(best.size), unit="%", beams=(best.beam + 1,),
            )
        ]  # fmt: skip
    if best.kind == "beam_direction":
        lean = np.rad2deg(min(tilt(best.rows[best.beam]), np.pi - tilt(best.rows[best.beam])))
        return [
            Finding(
                "mistilted_beam", severity, float(abs(np.sin(best.size))),
                f"Beam {best.beam + 1} is {np.rad2deg(best.size):.2f} deg off the direction{against or ' stated'} "
                f"(tilt {lean:.2f} deg).",
                f"± {np.rad2deg(best.size_sd):.1g} deg; {np.rad2deg(best.tilt_change_rad):+.2f} deg of it is tilt. "
                f"{evidence}",
                "Compare with the manufacturer's drawing; correct the geometry of this beam.",
                size=float(np.rad2deg(best.size)), unit="deg", beams=(best.beam + 1,),
            )
        ]  # fmt: skip
    return _common(best, matrix, evidence)


def _words(one: Explanation) -> str:
    if one.kind == "beam_scale":
        return f"scale of beam {one.beam + 1} {100.0 * one.size:+.2f} %"
    if one.kind == "beam_direction":
        return f"direction of beam {one.beam + 1} off by {np.rad2deg(one.size):.2f} deg"
    if one.kind == "none":
        return "nothing"
    name = {
        "scale": "a common scale",
        "tilt": "a common change of tilt",
        "rotation": "a rotation of the array",
    }
    return name[one.kind]


def _common(best: Explanation, matrix: Matrix, evidence: str) -> list[Finding]:
    """Findings of what all beams share."""
    everyone = tuple(range(1, len(matrix.rows) + 1))
    if best.kind == "scale":
        return [
            Finding(
                "scale", "warning", min(abs(best.size), 1.0),
                f"The scale of all beams differs from that of the instrument's velocity by {100.0 * best.size:+.2f} %.",
                f"± {100.0 * best.size_sd:.1g} %. {evidence}",
                "A common scale indicates a sound-speed correction of only one of the two.",
                size=100.0 * abs(best.size), unit="%", beams=everyone,
            )
        ]  # fmt: skip
    if best.kind == "tilt":
        lean = np.rad2deg(np.minimum(tilt(best.rows), np.pi - tilt(best.rows)))
        return [
            Finding(
                "wrong_tilt", "fault", float(abs(np.sin(best.size))),
                f"Every beam has a tilt of {lean.mean():.2f} deg, stated are "
                f"{lean.mean() - np.rad2deg(best.size):.2f} deg.",
                f"± {np.rad2deg(best.size_sd):.1g} deg. {evidence}",
                "This is the matrix that the instrument uses; correct the stated tilt.",
                size=float(np.rad2deg(best.size)), unit="deg", beams=everyone,
            )
        ]  # fmt: skip
    if best.kind == "rotation":
        return [
            Finding(
                "rotated_geometry", "fault", float(abs(np.sin(best.size))),
                f"The beams match the stated ones only after a common rotation of {np.rad2deg(best.size):.2f} deg.",
                f"± {np.rad2deg(best.size_sd):.1g} deg. {evidence}",
                "State the mounting, or rotate the instrument's velocity to the stated frame.",
                size=float(np.rad2deg(best.size)), unit="deg",
            )
        ]  # fmt: skip
    return []
