"""Findings from the beam matrix: order, signs, tilt, scale, bias."""

import numpy as np

from bottomlock.audit.beam_order import NEAR_RAD, Match
from bottomlock.audit.closure import Closure
from bottomlock.audit.findings import MATERIAL_MPS, MATERIAL_RAD, MATERIAL_SCALE, beam_words
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, READINGS_TO_VELOCITY, Matrix, tilt
from bottomlock.audit.robust import LEAST_BLOCKS, Array, sigmas_for
from bottomlock.recordings.finding import Finding

NOT_UNIQUE = (
    "It is the matrix of an instrument that solves these readings by least squares. With four beams a matrix with "
    "another multiple of the closure in each column fits as well, so that a channel changed after the instrument "
    "solved shows in every beam."
)


def unobservable_findings(log: BeamLog, matrix: Matrix | None, pings: int) -> list[Finding]:
    """Why beam directions are not observable in a log with the instrument's velocity: too few pings or motion."""
    if log.instrument_mps is None or not log.own_frame or log.beams < 3:
        return []
    if matrix is None:
        return [
            Finding(
                "too_few_pings", "note", 0.0,
                f"Beam directions are not observable in this log: only {pings} pings have all beams and the "
                "instrument's velocity.",
                f"At least {LEAST_PINGS} are needed.",
                "Record with bottom lock on all beams.",
                size=float(pings), unit="pings",
            )
        ]  # fmt: skip
    spread = log.instrument_mps[log.solved].std(axis=0)
    sd = np.rad2deg(matrix.direction_sd_rad)
    if matrix.blocks < LEAST_BLOCKS:
        return [
            Finding(
                "directions_not_observable", "note", 0.0,
                f"Beam directions are not observable in this log: the {pings} pings with all beams and the "
                "instrument's velocity are too few, or too correlated, for a standard deviation.",
                f"They are worth {matrix.blocks} independent blocks, needed are {LEAST_BLOCKS}.",
                "Record longer.",
                size=float(pings), unit="pings",
            )
        ]  # fmt: skip
    return [
        Finding(
            "directions_not_observable", "note", 0.0,
            "Beam directions are not observable in this log: the velocity varies too little.",
            f"Standard deviations {', '.join(f'{value:.2g}' for value in sd)} deg; the velocity varies by "
            f"{', '.join(f'{value:.2g}' for value in spread)} m/s in x, y, z.",
            "Record surge, sway and heave of a few decimetres per second.",
            size=float(sd.max()), unit="deg",
        )
    ]  # fmt: skip


def _degrees(values: Array, digits: int = 2) -> str:
    return ", ".join(f"{np.rad2deg(value):.{digits}f}" for value in values)


def match_findings(matrix: Matrix, matched: Match, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Differences from the stated geometry: common rotation, beams swapped, reversed or parallel."""
    found = []
    place = (
        f"Tilts {_degrees(matrix.tilt_rad)} deg, azimuths {_degrees(matrix.azimuth_rad, 1)} deg "
        f"from {matrix.pings} pings."
    )
    if matched.rotation.magnitude() > 1e-9:
        yaw, pitch, roll = matched.rotation.as_euler("ZYX", degrees=True)
        found.append(
            Finding(
                "rotated_geometry", "fault", 1.0,
                f"The beams match the stated ones only after a common rotation: roll {roll:.1f}, pitch {pitch:.1f}, "
                f"yaw {yaw:.1f} deg.",
                place,
                "State the mounting, or rotate the instrument's velocity to the stated frame.",
                size=float(np.rad2deg(matched.rotation.magnitude())), unit="deg",
            )
        )  # fmt: skip
    same = _same_way(matrix, copies)
    found += same
    parallel = {beam - 1 for one in same for beam in one.beams} | {
        beam - 1 for pair in copies for beam in pair
    }
    moved = [k for k, beam in enumerate(matched.beam) if beam != k and k not in parallel]
    if moved:
        pairs = ", ".join(f"channel {k + 1} is beam {matched.beam[k] + 1}" for k in moved)
        found.append(
            Finding(
                "swapped_beams", "fault", 1.0,
                f"The order is not the stated one: {pairs}.",
                place,
                "Use the geometry file that this audit writes, or correct the column map.",
                size=float(len(moved)), unit="beams", beams=tuple(k + 1 for k in moved),
            )
        )  # fmt: skip
    flipped = [int(k) for k in np.flatnonzero(matched.sign < 0) if int(k) not in parallel]
    if flipped:
        everything = len(flipped) == len(matched.sign)
        words = (
            "Every beam has the opposite sign of the stated geometry."
            if everything
            else f"{beam_words(flipped).capitalize()} {'has' if len(flipped) == 1 else 'have'} the opposite sign."
        )
        found.append(
            Finding(
                "all_signs_flipped" if everything else "sign_flipped", "fault", 1.0,
                words,
                place,
                "Use the geometry file that this audit writes.",
                size=float(len(flipped)), unit="beams", beams=tuple(k + 1 for k in flipped),
            )
        )  # fmt: skip
    return found


def parallel_beams(findings: list[Finding], copies: list[tuple[int, ...]]) -> set[int]:
    """Beams (from 0) of channels that are read twice."""
    same = [one.beams for one in findings if one.kind == "identical_beams"]
    return {beam - 1 for pair in [*same, *copies] for beam in pair}


def tilt_findings(matrix: Matrix, matched: Match, stated: Array, parallel: set[int]) -> list[Finding]:
    """Beams off their stated direction."""
    expected = matched.rotation.apply(matched.sign[:, None] * stated[matched.beam])
    sure = matched.off_rad > np.maximum(MATERIAL_RAD, sigmas_for(matrix.blocks) * matrix.direction_sd_rad)
    off = [int(k) for k in np.flatnonzero(sure) if int(k) not in parallel]
    if not off:
        return []
    # The tilt from the nearer end of the z axis, so that a reversed beam has the tilt of the others.
    lean, meant = (np.minimum(tilt(v), np.pi - tilt(v)) for v in (matrix.directions, expected))
    worst = max(off, key=lambda k: float(matched.off_rad[k]))
    listed = ", ".join(
        f"{np.rad2deg(matched.off_rad[k]):.2f} ± {np.rad2deg(matrix.direction_sd_rad[k]):.2g}" for k in off
    )
    return [
        Finding(
            "mistilted_beam", "fault", float(np.sin(matched.off_rad[worst])),
            f"In the matrix that the instrument uses {beam_words(off)} {'is' if len(off) == 1 else 'are'} off the "
            f"stated direction by up to {np.rad2deg(matched.off_rad[worst]):.2f} deg.",
            f"Off by {listed} deg; tilts {_degrees(lean)} deg, stated {_degrees(meant)}; azimuths "
            f"{_degrees(matrix.azimuth_rad, 1)} deg; from {matrix.pings} pings. {NOT_UNIQUE}",
            "Compare with the manufacturer's drawing; correct the stated geometry, or the channel.",
            size=float(np.rad2deg(matched.off_rad[worst])), unit="deg", beams=tuple(k + 1 for k in off),
        )
    ]  # fmt: skip


def _same_way(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Channels with different numbers but parallel (or antiparallel) directions."""
    found = []
    u = matrix.directions
    for i in range(len(u)):
        for j in range(i + 1, len(u)):
            angle = float(np.arccos(np.clip(abs(u[i] @ u[j]), 0.0, 1.0)))
            if angle < NEAR_RAD and (i + 1, j + 1) not in copies:
                found.append(
                    Finding(
                        "identical_beams", "fault", 1.0,
                        f"{beam_words([i, j]).capitalize()} are parallel within {np.rad2deg(angle):.2f} deg.",
                        f"± {np.rad2deg(np.hypot(*matrix.direction_sd_rad[[i, j]])):.2g} deg from "
                        f"{matrix.pings} pings.",
                        "One transducer is read twice: correct the wiring or the column map.",
                        size=float(np.rad2deg(angle)), unit="deg", beams=(i + 1, j + 1),
                    )
                )  # fmt: skip
    return found


def self_findings(matrix: Matrix, copies: list[tuple[int, ...]]) -> list[Finding]:
    """Beams that differ from the others, where no geometry is stated."""
    found = _same_way(matrix, copies)
    up = matrix.directions[:, 2] < 0.0
    if up.all() or (up.any() and up.sum() < len(up) / 2):
        reversed_ = [int(beam) for beam in np.flatnonzero(up)]
        found.append(
            Finding(
                "all_signs_flipped" if up.all() else "sign_flipped", "warning" if up.all() else "fault", 1.0,
                "Every beam is positive along −z: z points up, or readings are positive away from the bottom."
                if up.all()
                else f"{beam_words(reversed_).capitalize()} {'has' if len(reversed_) == 1 else 'have'} the opposite "
                "sign of the others.",
                f"Tilts {_degrees(matrix.tilt_rad)} deg.",
                "Use the geometry file that this audit writes; a recorded depth gives the direction of z.",
                size=float(len(reversed_)), unit="beams", beams=tuple(beam + 1 for beam in reversed_),
            )
        )  # fmt: skip
    return found


def scale_findings(matrix: Matrix, expected: Array | float = 1.0) -> list[Finding]:
    """Beams whose scale differs from the expected one (beams,) against the instrument's velocity."""
    off = matrix.scale / expected - 1.0
    sure = np.abs(off) > np.maximum(MATERIAL_SCALE, sigmas_for(matrix.blocks) * matrix.scale_sd)
    if not sure.any():
        return []
    k = [int(beam) for beam in np.flatnonzero(sure)]
    listed = ", ".join(f"{matrix.scale[b]:.4f} ± {matrix.scale_sd[b]:.1g}" for b in range(len(off)))
    return [
        Finding(
            "scale", "warning", float(np.abs(off).max()),
            f"The scale of {beam_words(k)} differs from that of the instrument's velocity by up to "
            f"{100.0 * off[np.argmax(np.abs(off))]:+.2f} %.",
            f"Scales {listed}.",
            "A common scale indicates a sound-speed correction of only one of the two; a single one a fault of that "
            "beam.",
            size=float(100.0 * np.abs(off).max()), unit="%", beams=tuple(b + 1 for b in k),
        )
    ]  # fmt: skip


def bias_findings(matrix: Matrix, closures: list[Closure]) -> list[Finding]:
    """Beams that are biased against the instrument's own velocity.

    The regression observes the biases that act like a velocity, the closure the rest. A bias that the instrument has
    included in its velocity is observed by the closure alone.
    """
    if not (
        np.abs(matrix.bias_mps) > np.maximum(MATERIAL_MPS, sigmas_for(matrix.blocks) * matrix.bias_sd_mps)
    ).any():
        return []
    bias, variance = matrix.bias_mps.copy(), matrix.bias_sd_mps**2
    # A regression of the readings holds the whole bias; one of the velocity lacks the part in the closure.
    for one in closures if matrix.regression == READINGS_TO_VELOCITY else []:
        share = one.weights / float(one.weights @ one.weights)
        bias += share * one.median_mps
        variance = variance + (share * one.median_sd_mps) ** 2
    sd = np.sqrt(variance)
    return [
        Finding(
            "beam_bias", "warning", float(min(abs(bias[k]), 1.0)),
            f"Beam {k + 1} has a bias of {1e3 * bias[k]:+.1f} mm/s against the instrument's velocity and the other "
            "beams.",
            f"± {1e3 * sd[k]:.1g} mm/s. The part that the instrument has included in its velocity is not observable.",
            "Subtract it, or let the filter estimate beam biases.",
            size=float(1e3 * bias[k]), unit="mm/s", beams=(int(k) + 1,),
        )
        for k in np.flatnonzero(np.abs(bias) > np.maximum(MATERIAL_MPS, sigmas_for(matrix.blocks) * sd))
    ]  # fmt: skip
