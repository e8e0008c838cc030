"""The beams as the instrument's velocity sees them, said in words: order, signs, tilt, scale, bias."""

import numpy as np

from bottomlock.audit.beam_order import NEAR_RAD, Match
from bottomlock.audit.closure import Closure
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_RAD, MATERIAL_SCALE, SIGMAS, Finding, beam_words
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, Matrix, tilt
from bottomlock.audit.robust import Array


def unobservable_findings(log: BeamLog, matrix: Matrix | None, pings: int) -> list[Finding]:
    """Why a log with the instrument's velocity does not tell the directions: too few pings, or too little motion."""
    if log.instrument_mps is None or not log.own_frame or log.beams < 3:
        return []
    if matrix is None:
        return [
            Finding(
                "too_few_pings", "note", float(pings), "pings", 0.0,
                f"Only {pings} pings have all beams and the instrument's velocity: directions are not "
                "observable in this log.",
                f"{LEAST_PINGS} are the least that is used.", "Record with lock on all beams.",
            )
        ]  # fmt: skip
    spread = log.instrument_mps[log.solved].std(axis=0)
    sd = np.rad2deg(matrix.direction_sd_rad)
    return [
        Finding(
            "directions_not_observable", "note", float(sd.max()), "deg", 0.0,
            "Beam directions are not observable in this log: it moves too little.",
            f"Standard deviations {', '.join(f'{value:.2g}' for value in sd)} deg; the velocity varies by "
            f"{', '.join(f'{value:.2g}' for value in spread)} m/s in x, y, z.",
            "Record surge, sway and heave of a few decimetres per second.",
        )
    ]  # fmt: skip


def _degrees(values: Array, digits: int = 2) -> str:
    return ", ".join(f"{np.rad2deg(value):.{digits}f}" for value in values)


def match_findings(
    matrix: Matrix, matched: Match, stated: Array, copies: list[tuple[int, ...]]
) -> list[Finding]:
    """What differs from the stated geometry: the whole turned, beams swapped, flipped, alike or mistilted."""
    found = []
    place = (
        f"Tilts {_degrees(matrix.tilt_rad)} deg, azimuths {_degrees(matrix.azimuth_rad, 1)} deg "
        f"from {matrix.pings} pings."
    )
    if matched.turn.magnitude() > 1e-9:
        yaw, pitch, roll = matched.turn.as_euler("ZYX", degrees=True)
        found.append(
            Finding(
                "turned_as_a_whole", "fault", float(np.rad2deg(matched.turn.magnitude())), "deg", 1.0,
                f"The beams fit the stated ones only when these are turned as a whole: roll {roll:.1f}, pitch "
                f"{pitch:.1f}, yaw {yaw:.1f} deg.",
                place, "State the mounting, or bring the instrument's velocity into the stated frame.",
            )
        )  # fmt: skip
    same = _same_way(matrix, copies)
    found += same
    twins = {beam - 1 for one in same for beam in one.beams} | {beam - 1 for pair in copies for beam in pair}
    moved = [k for k, beam in enumerate(matched.beam) if beam != k and k not in twins]
    if moved:
        pairs = ", ".join(f"channel {k + 1} is beam {matched.beam[k] + 1}" for k in moved)
        found.append(
            Finding(
                "swapped_beams", "fault", float(len(moved)), "beams", 1.0,
                f"The order is not the stated one: {pairs}.", place,
                "Use the geometry file that this audit writes, or mend the column map.", tuple(k + 1 for k in moved),
            )
        )  # fmt: skip
    flipped = [int(k) for k in np.flatnonzero(matched.sign < 0) if int(k) not in twins]
    if flipped:
        everything = len(flipped) == len(matched.sign)
        words = (
            "Every beam reads positive the other way than stated."
            if everything
            else f"{beam_words(flipped).capitalize()} {'reads' if len(flipped) == 1 else 'read'} with the sign flipped."
        )
        found.append(
            Finding(
                "all_signs_flipped" if everything else "sign_flipped", "fault", float(len(flipped)), "beams", 1.0,
                words, place, "Use the geometry file that this audit writes.", tuple(k + 1 for k in flipped),
            )
        )  # fmt: skip
    return found + _tilt_findings(matrix, matched, stated, twins, place)


def _tilt_findings(
    matrix: Matrix, matched: Match, stated: Array, twins: set[int], place: str
) -> list[Finding]:
    """Beams that do not look where they are stated; one finding if all of them are off by the same tilt."""
    expected = matched.turn.apply(matched.sign[:, None] * stated[matched.beam])
    sure = matched.off_rad > np.maximum(MATERIAL_RAD, SIGMAS * matrix.direction_sd_rad)
    off = [int(k) for k in np.flatnonzero(sure) if int(k) not in twins]
    # From the axis that the beam leans away from, so that a reversed beam leans like the others.
    lean, meant = (np.minimum(tilt(v), np.pi - tilt(v)) for v in (matrix.directions, expected))
    change = lean - meant
    alike = float(np.ptp(change)) < 0.5 * MATERIAL_RAD
    if len(off) == len(sure) and alike and bool((matched.off_rad < 1.2 * np.abs(change)).all()):
        size = float(np.rad2deg(np.mean(change)))
        return [
            Finding(
                "wrong_tilt", "fault", size, "deg", abs(float(np.sin(np.mean(change)))),
                f"Every beam leans {np.rad2deg(lean.mean()):.2f} deg from the vertical, "
                f"not {np.rad2deg(meant.mean()):.2f} as stated.",
                f"± {np.rad2deg(matrix.direction_sd_rad.max()):.2g} deg. {place}",
                "This is the matrix that the instrument uses; correct the stated tilt.",
                tuple(k + 1 for k in off),
            )
        ]  # fmt: skip
    return [
        Finding(
            "mistilted_beam", "fault", float(np.rad2deg(matched.off_rad[k])), "deg",
            float(np.sin(matched.off_rad[k])),
            f"Beam {k + 1} looks {np.rad2deg(matched.off_rad[k]):.2f} deg off its stated direction "
            f"(it leans {np.rad2deg(lean[k]):.2f} deg instead of {np.rad2deg(meant[k]):.2f}).",
            f"± {np.rad2deg(matrix.direction_sd_rad[k]):.2g} deg; {np.rad2deg(change[k]):+.2f} deg of it is tilt. "
            f"{place}",
            "This is the matrix that the instrument uses; correct the stated geometry.", (k + 1,),
        )
        for k in off
    ]  # fmt: skip


def _same_way(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Channels that are not the same numbers but look the same way (or just the other)."""
    found = []
    u = matrix.directions
    for i in range(len(u)):
        for j in range(i + 1, len(u)):
            angle = float(np.arccos(np.clip(abs(u[i] @ u[j]), 0.0, 1.0)))
            if angle < NEAR_RAD and (i + 1, j + 1) not in copies:
                found.append(
                    Finding(
                        "identical_beams", "fault", float(np.rad2deg(angle)), "deg", 1.0,
                        f"{beam_words([i, j]).capitalize()} look the same way, within {np.rad2deg(angle):.2f} deg.",
                        f"± {np.rad2deg(np.hypot(*matrix.direction_sd_rad[[i, j]])):.2g} deg from "
                        f"{matrix.pings} pings.",
                        "One transducer is read twice: mend the wiring or the column map.", (i + 1, j + 1),
                    )
                )  # fmt: skip
    return found


def self_findings(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """What stands out among the beams themselves when no geometry is stated."""
    found = _same_way(matrix, copies)
    twins = {beam for one in found for beam in one.beams} | {beam for pair in copies for beam in pair}
    up = matrix.directions[:, 2] < 0.0
    if up.all() or (up.any() and up.sum() < len(up) / 2):
        reversed_ = [int(beam) for beam in np.flatnonzero(up)]
        found.append(
            Finding(
                "all_signs_flipped" if up.all() else "sign_flipped", "warning" if up.all() else "fault",
                float(len(reversed_)), "beams", 1.0,
                "Every beam reads positive along −z: z is up, or readings are positive towards the instrument."
                if up.all()
                else f"{beam_words(reversed_).capitalize()} read the other way than the rest.",
                f"Tilts {_degrees(matrix.tilt_rad)} deg.",
                "Use the geometry file that this audit writes; the depth rate tells which way z points.",
                tuple(beam + 1 for beam in reversed_),
            )
        )  # fmt: skip
    lean = np.where(up, np.pi - matrix.tilt_rad, matrix.tilt_rad)
    for k in range(len(lean)):
        others = np.delete(lean, k)
        off = float(lean[k] - np.median(others))
        alike = float(np.max(np.abs(others - np.median(others))))
        if k + 1 not in twins and abs(off) > max(
            2.0 * MATERIAL_RAD, SIGMAS * matrix.direction_sd_rad[k], 3.0 * alike
        ):
            found.append(
                Finding(
                    "mistilted_beam", "warning", float(np.rad2deg(abs(off))), "deg", abs(float(np.sin(off))),
                    f"Beam {k + 1} has a tilt of {np.rad2deg(lean[k]):.2f} deg, the others {_degrees(others)}.",
                    f"± {np.rad2deg(matrix.tilt_sd_rad[k]):.2g} deg from {matrix.pings} pings.",
                    "Compare with the maker's drawing; this is the matrix that the instrument uses.", (k + 1,),
                )
            )  # fmt: skip
    return found


def scale_findings(matrix: Matrix) -> list[Finding]:
    """Beams whose readings are longer or shorter than the instrument's velocity asks for."""
    off = matrix.scale - 1.0
    sure = np.abs(off) > np.maximum(MATERIAL_SCALE, SIGMAS * matrix.scale_sd)
    if not sure.any():
        return []
    k = [int(beam) for beam in np.flatnonzero(sure)]
    listed = ", ".join(f"{matrix.scale[b]:.4f} ± {matrix.scale_sd[b]:.1g}" for b in range(len(off)))
    return [
        Finding(
            "scale", "warning", float(100.0 * np.abs(off).max()), "%", float(np.abs(off).max()),
            f"{beam_words(k).capitalize()} {'differs' if len(k) == 1 else 'differ'} in scale from the "
            "instrument's velocity "
            f"by up to {100.0 * off[np.argmax(np.abs(off))]:+.2f} %.",
            f"Scales {listed}.",
            "A common scale is a sound speed that one of the two was not corrected for; a single one is a fault "
            "of that beam.",
            tuple(b + 1 for b in k),
        )
    ]  # fmt: skip


def bias_findings(matrix: Matrix, closures: list[Closure]) -> list[Finding]:
    """Beams that are biased against the instrument's own velocity.

    The regression sees the biases that look like a velocity, the closure sees the rest; together they are whole. A
    bias that the instrument has taken into its velocity is not seen by the first: then only the closure speaks.
    """
    if not (np.abs(matrix.bias_mps) > np.maximum(MATERIAL_MPS, SIGMAS * matrix.bias_sd_mps)).any():
        return []
    bias, variance = matrix.bias_mps.copy(), matrix.bias_sd_mps**2
    for one in closures:
        share = one.weights / float(one.weights @ one.weights)
        bias += share * one.median_mps
        variance = variance + (share * one.median_sd_mps) ** 2
    sd = np.sqrt(variance)
    return [
        Finding(
            "beam_bias", "warning", float(1e3 * bias[k]), "mm/s", float(min(abs(bias[k]), 1.0)),
            f"Beam {k + 1} reads {1e3 * bias[k]:+.1f} mm/s where the instrument's velocity and the other beams "
            "ask for zero.",
            f"± {1e3 * sd[k]:.1g} mm/s. What the instrument has taken into its own velocity is not in it.",
            "Subtract it, or let the filter estimate beam biases.", (int(k) + 1,),
        )
        for k in np.flatnonzero(np.abs(bias) > np.maximum(MATERIAL_MPS, SIGMAS * sd))
    ]  # fmt: skip
