"""Checks of a log alone: lock, times, stale and stuck readings, zeros, copied channels, flags."""

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.stats import poisson

from bottomlock.audit.findings import SIGNIFICANCE, Told, finding
from bottomlock.audit.logs import Array, BeamLog
from bottomlock.audit.robust import resolution
from bottomlock.recordings.drives import FASTEST_MPS
from bottomlock.recordings.finding import Finding, Severity

Flags = NDArray[np.bool_]

SHORTEST_RUN = 10
"""Equal readings in a row that are looked at, whatever the resolution."""
GAP = 2.5
"""A step longer than this many median steps is a gap."""
_NEAREST = 60
"""Number of values nearest to zero that give the expected count of exact zeros."""


def why_never_locked(log: BeamLog) -> str:
    """Why the log never had lock; empty where it had.

    A beam in air or mid-water reads something, zero or the last value, and some instruments flag it valid: the order,
    the closure and the repeats of such readings say nothing of the instrument.
    """
    valid = log.valid & np.isfinite(log.velocity_mps)
    if log.instrument_valid is not None and not log.instrument_valid.any():
        return f"the instrument flags its velocity invalid in all {log.pings} pings"
    if log.beams and not valid.any() and not log.solved.any():
        return f"no beam is valid in any of {log.pings} pings"
    if log.beams and valid.any() and not (log.velocity_mps[valid] != 0.0).any():
        return f"every reading of {log.pings} pings is exactly zero"
    if not log.beams and log.error_velocity_mps is None and not log.solved.any():
        return f"no velocity is valid in any of {log.pings} pings"
    return ""


def never_locked(log: BeamLog) -> Iterator[Finding]:
    """That the log never had lock, and why."""
    why = why_never_locked(log)
    if why:
        flagged = int(log.full.sum()) if log.beams else 0
        yield finding("never_locked", log.pings, why=why, flagged=flagged)


def reader(log: BeamLog) -> Iterator[Finding]:
    """Records that the reader skipped or flagged, from the account beside the table."""
    read = float(log.beside.get("records_read", 0) or 1)
    for fate, what in (("skipped", "gave no row"), ("flagged", "were kept with a change")):
        reasons = log.beside.get(fate, {})
        for name, reason in (reasons if isinstance(reasons, dict) else {}).items():
            count = int(reason["count"])
            first = ", ".join(f"{key} {value}" for key, value in reason.items() if key != "count")
            told: Told = {"read": read, "what": what, "name": name, "first": first}
            yield finding(f"reader_{fate}", count, min(count / read, 1.0), **told)


def times(log: BeamLog) -> Iterator[Finding]:
    """Times that repeat or go back (faults: the readers reject them), and gaps."""
    if log.pings < 3:
        return
    steps, told = np.diff(log.time_ns) * 1e-9, Told()
    for kind, where, what in (
        ("time_repeats", steps == 0.0, "repeat the time of the ping before"),
        ("time_goes_back", steps < 0.0, "go back in time"),
    ):
        if where.any():
            row = _first(where) + 1
            told = {"log": log, "what": what, "before": log.time_ns[row - 1], "after": log.time_ns[row]}
            yield finding(kind, where.sum(), where.mean(), row=row, **told)
    rising = steps[steps > 0.0]
    usual = float(np.median(rising)) if rising.size else np.inf
    gaps = steps[steps > GAP * usual]
    if gaps.size:
        missing, span = float(np.sum(gaps) - usual * gaps.size), float(max(log.time_s.max(), 1e-9))
        part, row = min(missing / span, 1.0), int(np.argmax(steps)) + 1
        told = {"missing": missing, "span": span, "usual": usual, "longest": gaps.max(), "row": row}
        yield finding("time_gaps", gaps.size, part, severity="warning" if part > 0.01 else "note", **told)


def _first(flags: Flags) -> int:
    return int(np.argmax(flags))


def stale(log: BeamLog) -> Iterator[Finding]:
    """Whole pings that repeat unchanged, more often than readings of this resolution coincide by chance."""
    same, y = log.unchanged, log.velocity_mps
    if not same.any() or not log.beams:
        return
    used = (log.valid | same[:, None]) & np.isfinite(y) & (y != 0.0)
    both = used[1:] & used[:-1]
    others = both & ~same[1:, None]
    alone = (others & (y[1:] == y[:-1])).sum(axis=0) / np.maximum(others.sum(axis=0), 1)
    count, pairs = int(same.sum()), int(both.any(axis=1).sum())
    chance, part = pairs * float(np.prod(np.sort(alone)[: max(2, log.beams - 1)])), count / max(pairs, 1)
    if poisson.sf(count - 1, chance + 1e-9) <= SIGNIFICANCE:
        longest = np.bincount(label(same)[0])[1:].max()
        told: Told = {"chance": chance, "row": _first(same), "longest": longest}
        yield finding("stale_pings", count, part, severity="fault" if part > 0.01 else "warning", **told)


def stuck(log: BeamLog) -> Iterator[Finding]:
    """Beams that repeat one reading for longer than their resolution explains, while others change.

    Pings that repeat as a whole have a finding of their own.
    """
    y, runs, chance = log.velocity_mps, [], []
    valid = log.valid & np.isfinite(y) & (y != 0.0)
    for k in range(log.beams if log.beams > 1 else 0):
        rows = np.flatnonzero(valid[:, k] & ~log.unchanged)
        equal = np.diff(y[rows, k]) == 0.0
        run = label(equal)[0]
        lengths = np.bincount(run, minlength=2)[1:]
        runs.append(
            (int(lengths.max()) + 1, int(rows[_first(run == lengths.argmax() + 1)]))
            if equal.any()
            else (0, 0)
        )
        # Both ends of the readings count as a change.
        chance.append(float(equal.sum() / (equal.size + 2)) if rows.size else 0.0)
    for k, (length, row) in enumerate(runs):
        # By the resolution of the others: a stuck beam has made its own.
        equal_part = max(float(np.median(chance[:k] + chance[k + 1 :])), 1e-3)
        longest = max(np.log(SIGNIFICANCE / max(log.pings, 1)) / np.log(min(equal_part, 0.999)), SHORTEST_RUN)
        if length > longest:
            told: Told = {"value": y[row, k], "row": row, "time_s": log.time_s[row], "longest": longest}
            yield finding("stuck_beam", length, length / max(int(valid[:, k].sum()), 1), beams=[k], **told)


def zeros(log: BeamLog) -> Iterator[Finding]:
    """Beams flagged valid at exactly zero: more often than neighbouring values, and amid readings far from zero."""
    for k in range(log.beams):
        y = log.velocity_mps[log.valid[:, k], k]
        count, others = int(np.sum(y == 0.0)), np.sort(np.abs(y[y != 0.0]))
        if not count:
            continue
        quantum, near = resolution(y), others[:_NEAREST]
        # The count of each value next to zero: readings that pass through zero are exactly zero as often.
        reach = float(near[-1]) if near.size else 0.0
        within = int(np.searchsorted(others, reach, side="right"))
        usual = within * quantum / max(2.0 * reach, quantum) if quantum else 0.0
        if poisson.sf(count - 1, 1.5 * usual + 1e-3) <= SIGNIFICANCE and _apart(y) >= max(2, 0.3 * count):
            row = _first(log.valid[:, k] & (log.velocity_mps[:, k] == 0.0))
            told: Told = {"usual": usual, "quantum": quantum, "row": row}
            yield finding("zero_as_valid", count, count / y.size, beams=[k], **told)


def fast(log: BeamLog) -> Iterator[Finding]:
    """Readings that are none of a vehicle's velocity in m/s, in the median of the beams."""
    readings = np.abs(log.velocity_mps[log.valid & np.isfinite(log.velocity_mps)])
    size = float(np.median(readings)) if readings.size else 0.0
    if size > FASTEST_MPS:
        yield finding("too_fast", size, readings=readings.size, most=FASTEST_MPS)


def _apart(y: Array) -> int:
    """Number of zeros between readings more than five steps of resolution from zero.

    A vehicle at rest reads zero among values of a step or two.
    """
    other = np.flatnonzero(y != 0.0)
    if other.size < 3:
        return 0
    at = np.searchsorted(other, np.flatnonzero(y == 0.0))
    before, after = (np.abs(y[other[np.clip(at + shift, 0, other.size - 1)]]) for shift in (-1, 0))
    return int(np.sum(np.minimum(before, after) > 5.0 * resolution(y)))


def copies(log: BeamLog) -> Iterator[Finding]:
    """Channels that hold the numbers of another one, or these with the sign changed."""
    for i, j in itertools.combinations(range(log.beams), 2):
        both = log.valid[:, i] & log.valid[:, j] & (log.velocity_mps[:, i] != 0.0)
        a, b = log.velocity_mps[both, i], log.velocity_mps[both, j]
        for sign, reverse in ((1.0, ""), (-1.0, " with the sign changed")) if a.size >= 20 else ():
            part = float(np.mean(a == sign * b))
            if part > 0.5:
                yield finding("identical_beams", part, part, beams=(i, j), reverse=reverse, pings=a.size)


def instrument_flags(log: BeamLog) -> Iterator[Finding]:
    """Contradictions between the instrument's velocity flag and its beams.

    The velocity is flagged invalid with all beams valid, or valid with fewer than three. Stale pings are left out: a
    reader may have cleared their flags.
    """
    if log.instrument_valid is None or not log.beams:
        return
    count = log.valid.sum(axis=1)
    rejected = (count == log.beams) & ~log.instrument_valid & ~log.unchanged
    if rejected.any():
        part = float(rejected.sum() / max((count == log.beams).sum(), 1))
        severity: Severity = "note" if part < 0.2 else "warning"
        told: Told = {"of": log.beams, "row": _first(rejected)}
        yield finding("rejected_by_instrument", rejected.sum(), part, severity=severity, **told)
    given = (count < min(3, log.beams)) & log.instrument_valid & ~log.unchanged
    if given.any():
        yield finding("velocity_without_beams", given.sum(), given.mean(), row=_first(given))
