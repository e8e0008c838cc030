"""Defects of a log that need no geometry: times, stale pings, zeros that stand for nothing, copied channels."""

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.stats import poisson

from bottomlock.audit.findings import SIGNIFICANCE, Finding, beam_words
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.robust import Array, resolution

GAP = 2.5
"""A step of more than this many usual ones is a gap."""
_NEAREST = 60
"""How many of the values nearest to zero tell how often zero ought to occur."""


def time_findings(log: BeamLog) -> list[Finding]:
    """Times that repeat or go back (faults: no reader of a log accepts them), gaps, and a ragged clock."""
    if log.pings < 3:
        return []
    steps = np.diff(log.time_ns) * 1e-9
    found = []
    for kind, where, words in (
        ("time_repeats", steps == 0.0, "repeat the time before"),
        ("time_goes_back", steps < 0.0, "go back in time"),
    ):
        if where.any():
            first = int(np.flatnonzero(where)[0]) + 1
            part = float(where.mean())
            found.append(
                Finding(
                    kind, "fault", float(where.sum()), "pings", part,
                    f"{where.sum()} of {log.pings} pings {words}.",
                    f"First in row {first}: {log.time_ns[first]} ns after {log.time_ns[first - 1]} ns.",
                    "Take the instrument's time of validity instead of the host's, or drop these rows before "
                    "`bottomlock fix`.",
                )
            )  # fmt: skip
    rising = steps[steps > 0.0]
    if not rising.size:
        return found
    usual = float(np.median(rising))
    gaps = np.flatnonzero(steps > GAP * usual)
    if gaps.size:
        missing = float(np.sum(steps[gaps]) - usual * gaps.size)
        worst = int(gaps[np.argmax(steps[gaps])])
        span = float(max(log.time_s.max(), 1e-9))
        part = min(missing / span, 1.0)
        found.append(
            Finding(
                "time_gaps", "warning" if part > 0.01 else "note", float(gaps.size), "gaps", part,
                f"{gaps.size} {'gap' if gaps.size == 1 else 'gaps'} in time, together {missing:.3g} s of {span:.4g} s.",
                f"A usual step is {usual:.4g} s; the longest is {steps[worst]:.4g} s, before row {worst + 1}.",
                "Nothing, if the instrument was silent there; a filter coasts over them. Look for lost lines of "
                "the recording else.",
            )
        )  # fmt: skip
    return found


def unchanged(log: BeamLog) -> NDArray[np.bool_]:
    """(n,) a ping repeats all readings and flags of the ping before it; two readings at least are not zero."""
    same = np.zeros(log.pings, dtype=bool)
    if log.beams == 0:
        return same
    y, valid = log.velocity_mps, log.valid
    used = valid & np.isfinite(y)
    equal = (~used[1:] | (y[1:] == y[:-1])).all(axis=1) & (valid[1:] == valid[:-1]).all(axis=1)
    same[1:] = equal & ((used & (y != 0.0))[1:].sum(axis=1) >= 2)
    return same


def stale_findings(log: BeamLog, same: NDArray[np.bool_]) -> list[Finding]:
    """Whole pings that repeat unchanged, more often than chance lets readings of this resolution coincide.

    A reader that has marked them has taken their flags away; they count all the same.
    """
    if not same.any() or not log.beams:
        return []
    y = log.velocity_mps
    used = (log.valid | same[:, None]) & np.isfinite(y) & (y != 0.0)
    both = used[1:] & used[:-1]
    alone = [
        float(np.mean(y[1:, k][both[:, k] & ~same[1:]] == y[:-1, k][both[:, k] & ~same[1:]]))
        if (both[:, k] & ~same[1:]).any()
        else 0.0
        for k in range(log.beams)
    ]
    count, pairs = int(same.sum()), int(both.any(axis=1).sum())
    by_chance = pairs * float(np.prod(sorted(alone)[: max(2, log.beams - 1)]))
    if poisson.sf(count - 1, by_chance + 1e-9) > SIGNIFICANCE:
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    runs = edges[1::2] - edges[::2]
    part = count / max(pairs, 1)
    return [
        Finding(
            "stale_pings", "fault" if part > 0.01 else "warning", float(count), "pings", part,
            f"{count} pings ({100.0 * part:.2g} %) repeat the whole ping before them unchanged.",
            f"{by_chance:.2g} would by chance; first in row {int(np.flatnonzero(same)[0])}, longest run "
            f"{int(runs.max())} pings.",
            "Drop them: each counts an old reading as a new one, with an old velocity and a variance that is "
            "too small.",
        )
    ]  # fmt: skip


def zero_findings(log: BeamLog) -> list[Finding]:
    """Beams flagged valid at exactly zero: more often than the values next to zero occur, and out of place in time."""
    found = []
    for k in range(log.beams):
        y = log.velocity_mps[log.valid[:, k], k]
        zeros = int(np.sum(y == 0.0))
        if not zeros:
            continue
        quantum = resolution(y)
        reach = float(np.sort(np.abs(y[y != 0.0]))[:_NEAREST][-1]) if zeros < y.size else 0.0
        # As many as the values next to zero have each: readings that pass through zero hit it honestly.
        near = int(np.sum((np.abs(y) <= reach) & (y != 0.0)))
        usual = near * quantum / max(2.0 * reach, quantum) if quantum else 0.0
        if poisson.sf(zeros - 1, 1.5 * usual + 1e-3) > SIGNIFICANCE or _out_of_place(y) < max(2, 0.3 * zeros):
            continue
        part = zeros / y.size
        found.append(
            Finding(
                "zero_as_valid", "fault", float(zeros), "pings", part,
                f"Beam {k + 1} is flagged valid with a velocity of exactly zero in {zeros} pings "
                f"({100.0 * part:.2g} %).",
                f"{usual:.2g} would be usual beside values {quantum:.2g} m/s apart; "
                f"first in row {int(np.flatnonzero(log.valid[:, k] & (log.velocity_mps[:, k] == 0.0))[0])}.",
                "Treat zero as lost: clear the flag where the velocity is exactly zero.",
                (k + 1,),
            )
        )  # fmt: skip
    return found


def _out_of_place(y: Array) -> int:
    """How many zeros stand between readings that are more than five steps of resolution from zero.

    A vehicle at rest reads zero among values of a step or two.
    """
    rows = np.arange(y.size)
    other = rows[y != 0.0]
    if other.size < 3:
        return 0
    step = resolution(y)
    at = np.searchsorted(other, rows[y == 0.0])
    before = np.abs(y[other[np.maximum(at - 1, 0)]])
    after = np.abs(y[other[np.minimum(at, other.size - 1)]])
    return int(np.sum(np.minimum(before, after) > 5.0 * step))


def range_findings(log: BeamLog) -> list[Finding]:
    """Beams flagged valid whose range is zero or negative: no echo, or no range for a good velocity."""
    if log.range_m is None:
        return []
    found = []
    for k in range(log.beams):
        valid = log.valid[:, k]
        bad = valid & (log.range_m[:, k] <= 0.0)
        if bad.sum() > 0:
            part = float(bad.sum() / max(valid.sum(), 1))
            found.append(
                Finding(
                    "no_range", "note", float(bad.sum()), "pings", part,
                    f"Beam {k + 1} is flagged valid without a range in {bad.sum()} pings ({100.0 * part:.2g} %).",
                    f"First in row {int(np.flatnonzero(bad)[0])}.",
                    "Do not use the range as the only test of validity.",
                    (k + 1,),
                )
            )  # fmt: skip
    return found


def copy_findings(log: BeamLog) -> list[Finding]:
    """Channels that are the same numbers, or the same with the sign changed."""
    found = []
    for i, j in itertools.combinations(range(log.beams), 2):
        both = log.valid[:, i] & log.valid[:, j]
        a, b = log.velocity_mps[both, i], log.velocity_mps[both, j]
        moving = a != 0.0
        if moving.sum() < 20:
            continue
        for sign, words in ((1.0, "the same numbers"), (-1.0, "the same numbers with the sign changed")):
            part = float(np.mean(a[moving] == sign * b[moving]))
            if part > 0.5:
                found.append(
                    Finding(
                        "identical_beams", "fault", part, "of pings", part,
                        f"{beam_words([i, j]).capitalize()} hold {words} in {100.0 * part:.3g} % of "
                        f"{moving.sum()} pings.",
                        "Two transducers never agree to the last digit.",
                        "Look for a column that is read twice; until it is found use one of the two and treat "
                        "the other as lost.",
                        (i + 1, j + 1),
                    )
                )  # fmt: skip
    return found


def verdict_findings(log: BeamLog, same: NDArray[np.bool_]) -> list[Finding]:
    """Where the instrument's verdict and its beams part: refused with all beams, given with fewer than three.

    Stale pings are left out: a reader may have taken their flags away.
    """
    if log.instrument_valid is None or not log.beams:
        return []
    count = log.valid.sum(axis=1)
    found = []
    refused = (count == log.beams) & ~log.instrument_valid & ~same
    if refused.any():
        part = float(refused.sum() / max((count == log.beams).sum(), 1))
        found.append(
            Finding(
                "refused_by_instrument", "note" if part < 0.2 else "warning", float(refused.sum()), "pings", part,
                f"The instrument refuses its velocity in {refused.sum()} pings with all {log.beams} beams valid "
                f"({100.0 * part:.3g} %).",
                f"First in row {int(np.flatnonzero(refused)[0])}.",
                "A flag per beam does not make a good ping: gate by closure and by innovation as well.",
            )
        )  # fmt: skip
    given = (count < min(3, log.beams)) & log.instrument_valid & ~same
    if given.any():
        found.append(
            Finding(
                "velocity_without_beams", "fault", float(given.sum()), "pings", float(given.mean()),
                f"The instrument stands by a velocity in {given.sum()} pings with fewer than three valid beams.",
                f"First in row {int(np.flatnonzero(given)[0])}.",
                "Do not take that velocity: it rests on something that the log does not hold.",
            )
        )  # fmt: skip
    return found
