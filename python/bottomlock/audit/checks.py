"""The checks of an audit: each says of a log, with what stands beside it, what it finds."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from bottomlock.audit import defects
from bottomlock.audit.context import TURNED_RAD, Context
from bottomlock.audit.findings import FROM_FILE, MATERIAL_SCALE, Told, finding, with_sd
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, tilt
from bottomlock.audit.mounting import PARTS
from bottomlock.audit.robust import LEAST_BLOCKS, significant
from bottomlock.io.beams import packaged_geometries
from bottomlock.recordings.axes import from_angles, to_angles
from bottomlock.recordings.closure import closure_sd
from bottomlock.recordings.finding import Finding, Severity
from bottomlock.recordings.robust import white_sd

LEAST_THIRDS = 100
"""Least number of pings whose third differences give a noise."""
NOISIER = 2.5
"""Noise of a beam over the median of the others' from which it is a finding."""
EXPLAINED = (0.6, 1.6)
"""Closure over what the noises of the beams predict, between which these are noise and not motion."""
LogCheck = Callable[[BeamLog], Iterable[Finding]]
Check = Callable[[Context], Iterable[Finding]]


def noisy(context: Context) -> Iterator[Finding]:
    """Beams that are noisier than the others by their third differences, where the closure confirms these as noise."""
    readings, closures = context.beams.readings_mps, context.beams.closures
    if not closures or len(readings) < LEAST_THIRDS:
        return
    noise, closure, weights = white_sd(readings, 3), closures[0].sigma_mps, closures[0].weights
    predicted = float(np.sqrt(np.sum((weights * noise) ** 2)))
    if not predicted or not EXPLAINED[0] < closure / predicted < EXPLAINED[1]:
        return
    told: Told = {"pings": len(readings), "predicted": predicted, "closure": closure}
    for k, own in enumerate(noise):
        others = float(np.median(np.delete(noise, k)))
        if others > 0.0 and own >= NOISIER * others:
            yield finding("noisy_beam", own / others, beams=[k], own=own, others=others, **told)


def unobservable(context: Context) -> Iterator[Finding]:
    """Why closure or beam directions are not observable: too few pings, or too little motion."""
    log, matrix, full = context.log, context.matrix, context.whole
    own = log.instrument_mps is not None and log.own_frame and log.beams >= 3
    if own and matrix is None:
        what, and_what, full = "Beam directions are", " and the instrument's velocity", full & log.solved
    else:
        what, and_what = "Neither closure nor order of the beams is", ""
    if matrix is None and (own or log.beams > 3) and full.sum() < LEAST_PINGS:
        told: Told = {"what": what, "and_what": and_what, "least": LEAST_PINGS}
        yield finding("too_few_pings", full.sum(), 0.0, **told)
    elif matrix is not None and not context.beams.seen and log.instrument_mps is not None:
        size, spread = np.rad2deg(matrix.direction_sd_rad).max(), log.instrument_mps[log.solved].std(axis=0)
        yield finding("directions_not_observable", size, 0.0, of=matrix, spread=spread, least=LEAST_BLOCKS)


def order(context: Context) -> Iterator[Finding]:
    """The simplest order in which the beams close far better than in the stated one, if any."""
    other = context.beams.reordered
    if other is None or (other.or_bias and not context.beams.doubtful):
        return
    first, advice = other.orders[0], FROM_FILE
    if len(other.orders) > 1:
        advice = "Closure cannot distinguish these; record the instrument's velocity, or a known motion."
    kind = "sign_flipped/closure" if first.steps == 1 and min(first.sign) < 0 else "swapped_beams/closure"
    kind = "order_or_bias" if other.or_bias else kind
    yield finding(kind, other.ratio, beams=other.moved, order=other, advice=advice)


def signs(context: Context) -> Iterator[Finding]:
    """Beams of the opposite sign of the stated ones; without these, of the opposite sign of most others."""
    matrix, stated = context.beams.seen, context.beams.match is not None
    if matrix is None:
        return
    up = [int(beam) for beam in np.flatnonzero(matrix.directions[:, 2] < 0.0)]
    flipped, beams = context.beams.flipped if stated else up, len(matrix.rows)
    if len(flipped) == beams:
        severity: Severity = "fault" if stated else "warning"
        yield finding("all_signs_flipped", beams, beams=flipped, severity=severity, of=matrix)
    elif flipped and (stated or len(flipped) < beams / 2):
        yield finding("sign_flipped", len(flipped), beams=flipped, of=matrix)


def matched(context: Context) -> Iterator[Finding]:
    """Differences from the stated geometry: common rotation, beams swapped or off their direction."""
    beams, matrix, match, stated = context.beams, context.beams.seen, context.beams.match, context.stated_rows
    if matrix is None or match is None or stated is None:
        return
    if beams.turned_rad > TURNED_RAD:
        rpy = to_angles(match.rotation)
        yield finding("rotated_geometry", np.rad2deg(beams.turned_rad), of=matrix, rpy=rpy)
    if beams.moved:
        pairs = ", ".join(f"channel {k + 1} is beam {match.beam[k] + 1}" for k in beams.moved)
        yield finding("swapped_beams", len(beams.moved), beams=beams.moved, of=matrix, pairs=pairs)
    if beams.off:
        worst = max(beams.off, key=lambda k: float(match.off_rad[k]))
        expected = tilt(match.rotation.apply(match.sign[:, None] * stated[match.beam]))
        # From the nearer end of the z axis, so that a reversed beam has the tilt of the others.
        expected = np.minimum(expected, np.pi - expected)
        angles, sds = np.rad2deg(match.off_rad), np.rad2deg(matrix.direction_sd_rad)
        told: Told = {"of": matrix, "off": with_sd(angles[beams.off], sds[beams.off]), "stated": expected}
        weight = np.sin(match.off_rad[worst])
        yield finding("mistilted_beam", angles[worst], weight, beams=beams.off, sd=sds[worst], **told)


def scale(context: Context) -> Iterator[Finding]:
    """Beams whose scale differs from the stated one, or from 1, against the instrument's velocity."""
    matrix, match, stated = context.beams.seen, context.beams.match, context.stated_rows
    if matrix is None:
        return
    expected = 1.0 if match is None or stated is None else np.linalg.norm(stated[match.beam], axis=1)
    off = matrix.scale / expected - 1.0
    sure = np.flatnonzero(significant(off, matrix.scale_sd, matrix.blocks, MATERIAL_SCALE))
    if len(sure):
        worst = int(np.argmax(np.abs(off)))
        sizes, size = with_sd(matrix.scale, matrix.scale_sd, ".4f", ".1g"), float(abs(off[worst]))
        told: Told = {"sd": 100.0 * matrix.scale_sd[worst], "signed": off[worst], "scales": sizes}
        yield finding("scale", 100.0 * size, size, beams=sure, **told)


def bias(context: Context) -> Iterator[Finding]:
    """Beams that are biased against the instrument's own velocity."""
    for k, (size, sd) in context.beams.biased.items():
        yield finding("beam_bias", 1e3 * size, min(abs(size), 1.0), beams=[k], sd=1e3 * sd)


def closures(context: Context) -> Iterator[Finding]:
    """A closure that depends on the velocity, is biased (unless that is explained), or has tails heavier than Gaussian.

    One that depends on it has other beam directions or scales than the matrix. A named bias is named once.
    """
    beams, slope = context.beams, context.beams.slope
    if slope is not None and beams.depends:
        told = with_sd(slope.slope, np.sqrt(np.diag(slope.cov)), "+.3f")
        weight = min(float(np.linalg.norm(slope.slope)), 1.0)
        yield finding("closure_depends_on_velocity", 1e3 * slope.effect_mps, weight, slope=told, of=slope)
    for one in context.closures:
        if one.biased and not (beams.biased or beams.doubtful or beams.depends):
            size, sd = 1e3 * one.median_mps, 1e3 * one.median_sd_mps
            yield finding("closure_bias", size, min(abs(one.median_mps), 1.0), sd=sd, of=one)
        if one.heavy:
            yield finding("heavy_tails", one.beyond_3_sigma, one.beyond_3_sigma, of=one)


def packaged(context: Context) -> Iterator[Finding]:
    """The packaged geometry that fits where the stated one does not, or where none is stated.

    Closure alone shows neither tilt nor yaw: without the instrument's velocity several geometries fit where a stated
    one does not, and all of them are named.
    """
    log, beams, stated, name = context.log, context.beams, context.stated_rows, context.geometry_name
    own = stated is not None and name not in packaged_geometries()
    if own or context.whole.sum() < LEAST_PINGS or (stated is not None and beams.fits):
        return
    judged = bool(context.packaged) and (log.beams > 3 or beams.seen is not None)
    if not judged and beams.rows is None and not context.copies:
        yield finding("beams_alone", 0.0, 0.0)
    if not judged:
        return
    fits, readings = list(context.packaged), log.velocity_mps[context.whole]
    rows = {one: of.stated for one, of in context.packaged.items()} | {name: stated}
    sizes = {one: 1e3 * closure_sd(of, readings) for one, of in rows.items() if of is not None}
    known = ", ".join(f"{size:.1f} with {one}" for one, size in sizes.items() if np.isfinite(size))
    basis = f"Robust closure of a unit combination, mm/s: {known}." if known else ""
    match = context.packaged[fits[0]].match
    if len(fits) == 1 and match is not None:
        off = np.rad2deg(match.off_rad.max())
        basis += f" Every beam is within {off:.2f} deg of {fits[0]}, by the instrument's velocity."
    kind = "packaged_geometries" if stated is None else "another_geometry"
    kind = kind if len(fits) == 1 else "packaged_geometries/several"
    names = " or ".join(filter(None, [", ".join(fits[:-1]), fits[-1]]))
    yield finding(kind, len(fits), basis=basis, stated=name, fits=names)


def another_time(context: Context) -> Iterator[Finding]:
    """A reference that has no time in common with the log, of which nothing can be said."""
    log, other = context.log, context.reference
    if other is not None and not other.at(log.time_ns).kept.any():
        first, last = (f"{times[0]} to {times[-1]}" for times in (log.time_ns, other.time_ns))
        later_s = 1e-9 * float(other.time_ns[0] - log.time_ns[0])
        yield finding("another_time", later_s, log=first, other=last)


def mounting(context: Context) -> Iterator[Finding]:
    """A reference that does not explain the velocity, or only with a left-handed frame."""
    m = context.mounting
    if m is not None and not m.follows:
        yield finding("mounting_not_observable", m.explained, 0.0, of=m)
    elif m is not None and m.mirrored:
        yield finding("left_handed", of=m)


def parts(context: Context) -> Iterator[Finding]:
    """Mounting angles, lever arm, clock and scale other than stated, or not observable."""
    m = context.mounting
    if m is None or not m.follows:
        return
    turn = from_angles(*m.values["misalignment"]) * from_angles(*context.stated_rpy_rad).inv()
    arms = np.zeros((1, 3)) if context.stated is None else np.asarray(context.stated.lever_arms_p_m)
    stated = {"misalignment": context.stated_rpy_rad, "lever_arm": arms.mean(axis=0)}
    for kind, part in PARTS.items():
        value, sd = m.values[kind], m.sds[kind]
        meant = stated.get(kind, np.zeros(len(value)))
        # Angles are compared about the platform's axes, as their standard deviations are.
        off = turn.as_rotvec() if kind == "misalignment" else value - meant
        sure = significant(off, sd, m.blocks, part.least)
        unseen = ~sure & (sd > part.limit)
        shown = [
            f"{name} not observable" if blind else f"{name} {format(one, part.form)} ± {spread:.2g}".strip()
            for name, one, spread, blind in zip(
                part.names, part.factor * value, part.factor * sd, unseen, strict=True
            )
        ]
        told: Told = {"part": part, "of": m, "values": ", ".join(shown), "stated": part.factor * meant}
        if sure.any():
            size = float(np.linalg.norm(off[sure])) if len(off) > 1 else float(off[0])
            weight = abs(size) * (float(np.linalg.norm(m.rate_rms_radps)) if kind == "lever_arm" else 1.0)
            told["sd"] = float(part.factor * np.linalg.norm(sd[sure]))
            severity: Severity = "fault" if abs(size) > part.fault else "warning"
            yield finding(kind, part.factor * size, min(weight, 1.0), severity=severity, **told)
        elif unseen.any():
            names = [name for name, blind in zip(part.names, unseen, strict=True) if blind and name]
            told["names"] = f": {', '.join(names)}" if names else ""
            yield finding("not_observable", 0.0, 0.0, sds=part.factor * sd, **told)


ALWAYS: tuple[LogCheck, ...] = (defects.never_locked, defects.times, defects.reader)
"""Also of a log that never had lock, of which nothing else is judged."""
OF_LOG: tuple[LogCheck, ...] = (
    defects.stale, defects.stuck, defects.zeros, defects.fast, defects.copies, defects.instrument_flags,
)  # fmt: skip
"""Of a log alone."""
CHECKS: tuple[Check, ...] = (
    noisy, unobservable, order, signs, matched, scale, bias, closures, packaged, another_time, mounting, parts,
)  # fmt: skip
"""Of a log with what stands beside it."""
