"""The checks of an audit: each says of a log, with what stands beside it, what it finds."""

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from bottomlock.audit import beside, defects
from bottomlock.audit.beams import TURNED_RAD
from bottomlock.audit.context import Context
from bottomlock.audit.findings import (
    FROM_FILE,
    MATERIAL_SCALE,
    Told,
    finding,
    listed,
    with_sd,
)
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.matrix import LEAST_PINGS, Matrix, line_angle, tilt
from bottomlock.audit.robust import LEAST_BLOCKS, Array, significant
from bottomlock.io.beams import packaged_geometries
from bottomlock.recordings.closure import closure_sd
from bottomlock.recordings.finding import Finding, ranked

LogCheck = Callable[[BeamLog], Iterable[Finding]]
Check = Callable[[BeamLog, Context], Iterable[Finding]]


def _mmps(**sizes_mps: float) -> Told:
    return {name: 1e3 * size for name, size in sizes_mps.items()}


def noisy(log: BeamLog, context: Context) -> Iterator[Finding]:
    """Beams that are noisier than the others."""
    return defects.noisy(log, context.assessment.full, context.assessment.rows)


def unobservable(log: BeamLog, context: Context) -> Iterator[Finding]:
    """Why beam directions are not observable: too few pings, or too little motion in the instrument's velocity."""
    found = context.assessment
    told: Told = {"least": LEAST_PINGS}
    if (log.instrument_mps is None or not log.own_frame) and log.beams > 3 and found.full.sum() < LEAST_PINGS:
        yield finding("too_few_pings/closure", found.full.sum(), 0.0, told)
    if log.instrument_mps is None or not log.own_frame or log.beams < 3 or found.seen:
        return
    if found.matrix is None:
        yield finding("too_few_pings", (found.full & log.solved).sum(), 0.0, told)
        return
    sds, spread = np.rad2deg(found.matrix.direction_sd_rad), log.instrument_mps[log.solved].std(axis=0)
    told |= {"sds": listed(sds, ".2g"), "spread": listed(spread, ".2g")}
    told |= {"blocks": str(found.matrix.blocks), "least": str(LEAST_BLOCKS)}
    yield finding("directions_not_observable", sds.max(), 0.0, told)


def order(_: BeamLog, context: Context) -> Iterator[Finding]:
    """The simplest order in which the beams close far better than in the stated one, if any."""
    found = context.assessment.reordered
    if found is None or (found.or_bias and not context.assessment.doubtful):
        return
    best = found.orders[0]
    sizes = _mmps(plain=found.plain_mps, scatter=found.scatter_mps, best=found.best_mps)
    told = {"orders": found.words} | sizes
    told["advice"] = FROM_FILE
    if len(found.orders) > 1:
        told["advice"] = (
            "Closure cannot distinguish these; record the instrument's velocity, or a known motion."
        )
    kind = "sign_flipped/closure" if best.steps == 1 and min(best.sign) < 0 else "swapped_beams/closure"
    yield finding("order_or_bias" if found.or_bias else kind, found.ratio, told=told, beams=found.moved)


def _angles(matrix: Matrix) -> Told:
    tilts, azimuths = (np.rad2deg(one) for one in (matrix.tilt_rad, matrix.azimuth_rad))
    return {"tilts": listed(tilts), "azimuths": listed(azimuths, ".1f"), "pings": matrix.pings}


def matched(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Differences from the stated geometry: common rotation, beams swapped, reversed or off their direction."""
    one, stated = context.assessment, context.stated_rows
    found, matrix = one.match, one.matrix
    if found is None or matrix is None or stated is None:
        return
    told = _angles(matrix)
    if one.turned_rad > TURNED_RAD:
        rpy = listed(found.rotation.as_euler("ZYX", degrees=True)[::-1], ".1f")
        yield finding("rotated_geometry", np.rad2deg(one.turned_rad), told=told | {"rpy": rpy})
    if one.moved:
        pairs = ", ".join(f"channel {k + 1} is beam {found.beam[k] + 1}" for k in one.moved)
        yield finding("swapped_beams", len(one.moved), told=told | {"pairs": pairs}, beams=one.moved)
    if one.flipped:
        kind = "all_signs_flipped" if len(one.flipped) == len(found.sign) else "sign_flipped"
        yield finding(kind, len(one.flipped), told=told, beams=one.flipped)
    if one.off:
        worst = max(one.off, key=lambda k: float(found.off_rad[k]))
        expected = tilt(found.rotation.apply(found.sign[:, None] * stated[found.beam]))
        # From the nearer end of the z axis, so that a reversed beam has the tilt of the others.
        told["stated"] = listed(np.rad2deg(np.minimum(expected, np.pi - expected)))
        angles, sds = np.rad2deg(found.off_rad), np.rad2deg(matrix.direction_sd_rad)
        told["off"] = with_sd(angles[one.off], sds[one.off])
        weight = np.sin(found.off_rad[worst])
        yield finding("mistilted_beam", angles[worst], weight, told, beams=one.off, sd=sds[worst])


def unmatched(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Beams of the opposite sign of the others, where no geometry is stated."""
    matrix = context.assessment.matrix
    if matrix is None or not context.assessment.seen or context.stated_rows is not None:
        return
    up = [int(beam) for beam in np.flatnonzero(matrix.directions[:, 2] < 0.0)]
    if len(up) == len(matrix.rows):
        yield finding("all_signs_flipped", len(up), told=_angles(matrix), beams=up, severity="warning")
    elif 0 < len(up) < len(matrix.rows) / 2:
        yield finding("sign_flipped", len(up), told=_angles(matrix), beams=up)


def parallel(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Channels with different numbers but parallel (or antiparallel) directions."""
    matrix = context.assessment.matrix
    if matrix is None:
        return
    for i, j in context.assessment.parallel:
        size = np.rad2deg(line_angle(matrix.directions[i], matrix.directions[j]))
        sd = np.rad2deg(np.hypot(*matrix.direction_sd_rad[[i, j]]))
        yield finding("identical_beams/parallel", size, told={"pings": matrix.pings}, beams=(i, j), sd=sd)


def scale(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Beams whose scale differs from the stated one, or from 1, against the instrument's velocity."""
    found, matrix = context.assessment, context.assessment.matrix
    if matrix is None or not found.seen:
        return
    expected: Array | float = 1.0
    if found.match is not None and context.stated_rows is not None:
        expected = np.linalg.norm(context.stated_rows[found.match.beam], axis=1)
    off = matrix.scale / expected - 1.0
    sure = np.flatnonzero(significant(off, matrix.scale_sd, matrix.blocks, MATERIAL_SCALE))
    if len(sure):
        worst = int(np.argmax(np.abs(off)))
        sizes, weight = with_sd(matrix.scale, matrix.scale_sd, ".4f", ".1g"), float(abs(off[worst]))
        told = {"signed": 100.0 * off[worst], "scales": sizes}
        yield finding("scale", 100.0 * weight, weight, told, beams=sure, sd=100.0 * matrix.scale_sd[worst])


def bias(_: BeamLog, context: Context) -> Iterator[Finding]:
    """Beams that are biased against the instrument's own velocity."""
    found = context.assessment
    for k in found.biased:
        size, sd = 1e3 * found.bias_mps[k], 1e3 * found.bias_sd_mps[k]
        yield finding("beam_bias", size, min(abs(found.bias_mps[k]), 1.0), beams=[k], sd=sd)


def dependence(_: BeamLog, context: Context) -> Iterator[Finding]:
    """A closure that depends on the velocity: the beam directions or scales differ from the matrix."""
    found = context.assessment.slope
    if found is not None and found.material:
        told = {"slope": with_sd(found.slope, np.sqrt(np.diag(found.cov)), "+.3f"), "p": found.p_value}
        weight, told["lag"] = min(float(np.linalg.norm(found.slope)), 1.0), found.lag
        yield finding("closure_depends_on_velocity", 1e3 * found.effect_mps, weight, told)


def closures(_: BeamLog, context: Context) -> Iterator[Finding]:
    """A biased closure (unless it is already explained), or tails heavier than Gaussian ones."""
    for one in context.assessment.closures:
        if one.biased and not context.assessment.explained:
            size, weight = 1e3 * one.median_mps, min(abs(one.median_mps), 1.0)
            yield finding("closure_bias", size, weight, {"pings": one.pings}, sd=1e3 * one.median_sd_mps)
        if one.heavy:
            told = {"pings": one.pings} | _mmps(
                middle=one.median_abs_mps, robust=one.sigma_mps, p95=one.p95_mps, p99=one.p99_mps,
                top=one.max_mps,
            )  # fmt: skip
            yield finding("heavy_tails", one.beyond_3_sigma, one.beyond_3_sigma, told)


def packaged(log: BeamLog, context: Context) -> Iterator[Finding]:
    """The packaged geometry that fits where the stated one does not, or where none is stated.

    Closure alone shows neither tilt nor yaw: without the instrument's velocity several geometries fit where a stated
    one does not, and all of them are named.
    """
    found, stated, name = context.assessment, context.stated_rows, context.geometry_name
    if (
        not log.beams
        or found.full.sum() < LEAST_PINGS
        or (stated is not None and name not in packaged_geometries())
    ):
        return
    alone = found.rows is None
    if alone and not context.copies and (log.beams < 4 or not context.packaged):
        yield finding("beams_alone", 0.0, 0.0)
    if (log.beams < 4 and not found.seen) or (stated is not None and found.fits) or not context.packaged:
        return
    fits = list(context.packaged)
    rows = {one: of.stated for one, of in context.packaged.items()} | {name: stated}
    readings = log.velocity_mps[found.full]
    sizes = {one: 1e3 * closure_sd(of, readings) for one, of in rows.items() if of is not None}
    known = ", ".join(f"{size:.1f} with {one}" for one, size in sizes.items() if np.isfinite(size))
    told: Told = {
        "basis": f"Robust closure of a unit combination, mm/s: {known}." if known else "",
        "stated": name,
    }
    told["fits"] = f"{', '.join(fits[:-1])} or {fits[-1]}" if len(fits) > 1 else fits[0]
    only = context.packaged[fits[0]]
    if len(fits) == 1 and only.match is not None:
        off = np.rad2deg(only.match.off_rad.max())
        told["basis"] += f" Every beam is within {off:.2f} deg of {fits[0]}, by the instrument's velocity."
    kind = "packaged_geometries/several" if len(fits) > 1 else "packaged_geometries"
    yield finding(kind if stated is None or len(fits) > 1 else "another_geometry", len(fits), told=told)


ALWAYS: tuple[LogCheck, ...] = (defects.never_locked, defects.times, defects.reader)
"""Also of a log that never had lock, of which nothing else is judged."""
OF_LOG: tuple[LogCheck, ...] = (
    defects.stale, defects.stuck, defects.zeros, defects.fast, defects.ranges, defects.copies,
    defects.instrument_flags,
)  # fmt: skip
"""Of a log alone."""
CHECKS: tuple[Check, ...] = (
    noisy, unobservable, order, matched, unmatched, parallel, scale, bias, dependence, closures, packaged,
    beside.another_time, beside.mounting, beside.parts,
)  # fmt: skip
"""Of a log with what stands beside it."""


def found_in(context: Context) -> list[Finding]:
    """The findings of all checks, ranked, the worst first."""
    log = context.log
    found = [one for check in ALWAYS for one in check(log)]
    if context.locked:
        found += [one for check in OF_LOG for one in check(log)]
        found += [one for check in CHECKS for one in check(log, context)]
    return ranked(found)
