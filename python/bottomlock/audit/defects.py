"""Defects of a log that show without a geometry: no lock, times, stale pings, zeros flagged valid, copied channels."""

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.stats import poisson

from bottomlock.audit.closure import null_space
from bottomlock.audit.findings import SIGNIFICANCE, beam_words
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.robust import Array, resolution, sigma
from bottomlock.recordings.finding import Finding

SHORTEST_RUN = 10
"""Equal readings in a row that are looked at, whatever the resolution."""
LEAST_PINGS = 100
NOISIER = 2.5
"""Noise of a beam over the median of the others' from which it is a finding."""
EXPLAINED = (0.6, 1.6)
"""Closure over what the noises of the beams predict, between which these are noise and not motion."""
_THIRD = np.sqrt(20.0)
"""1 sigma of a third difference of white noise of 1."""


def stuck_findings(log: BeamLog, same: NDArray[np.bool_]) -> list[Finding]:
    """Beams that repeat one reading for longer than their resolution explains, while others change.

    Args:
        log: the pings.
        same: (n,) pings that repeat the whole ping before them, which have a finding of their own.
    """
    if log.beams < 2:
        return []
    y, valid = log.velocity_mps, log.valid & np.isfinite(log.velocity_mps) & (log.velocity_mps != 0.0)
    runs, chance = [], []
    for k in range(log.beams):
        rows = np.flatnonzero(valid[:, k] & ~same)
        equal = np.concatenate([[False], np.diff(y[rows, k]) == 0.0, [False]])
        edges = np.flatnonzero(np.diff(equal.astype(np.int8)))
        lengths = edges[1::2] - edges[::2] + 1
        best = int(np.argmax(lengths)) if lengths.size else 0
        runs.append((int(lengths[best]), int(rows[edges[2 * best]])) if lengths.size else (0, 0))
        chance.append(float(equal.mean()) if rows.size else 0.0)
    found = []
    for k, (length, row) in enumerate(runs):
        # By the resolution of the others: a stuck beam has made its own.
        equal_part = max(float(np.median([one for j, one in enumerate(chance) if j != k])), 1e-3)
        longest = max(np.log(SIGNIFICANCE / max(log.pings, 1)) / np.log(min(equal_part, 0.999)), SHORTEST_RUN)
        if length <= longest:
            continue
        part = length / max(int(valid[:, k].sum()), 1)
        found.append(
            Finding(
                "stuck_beam", "fault", part,
                f"Beam {k + 1} is stuck at {y[row, k]:.3f} m/s for {length} pings, {100.0 * part:.2g} % of its own.",
                f"First in row {row}, {log.time_s[row]:.1f} s; by chance the longest run is {longest:.0f} readings.",
                "Flag it invalid there: a reading that does not change is none.",
                size=float(length), unit="pings", beams=(k + 1,),
            )
        )  # fmt: skip
    return found


def noisy_findings(log: BeamLog, full: NDArray[np.bool_], rows: Array | None) -> list[Finding]:
    """Beams that are noisier than the others by their third differences, where the closure confirms these as noise.

    Args:
        log: the pings.
        full: (n,) pings with every beam.
        rows: (beams, 3) directions, for the closure; None leaves it out, and there is no finding.
    """
    if rows is None or log.beams < 4:
        return []
    steps = np.diff(log.time_ns)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    even = full[3:] & full[2:-1] & full[1:-2] & full[:-3]
    for shift in range(3):
        even &= np.abs(steps[shift : len(steps) - 2 + shift] - usual) < 0.5 * usual
    third = np.diff(log.velocity_mps, 3, axis=0)[even]
    if len(third) < LEAST_PINGS:
        return []
    noise = np.array([sigma(third[:, k]) for k in range(log.beams)]) / _THIRD
    weights = null_space(rows)[:, 0]
    closure = sigma(log.velocity_mps[full] @ weights)
    predicted = float(np.sqrt(np.sum((weights * noise) ** 2)))
    if not predicted or not EXPLAINED[0] < closure / predicted < EXPLAINED[1]:
        return []
    found = []
    for k, value in enumerate(noise):
        others = float(np.median(np.delete(noise, k)))
        if others <= 0.0 or value < NOISIER * others:
            continue
        found.append(
            Finding(
                "noisy_beam", "warning", 1.0,
                f"Beam {k + 1} is {value / others:.1f} times noisier than the others: {1e3 * value:.1f} mm/s against "
                f"{1e3 * others:.1f} mm/s.",
                f"Third differences of {len(third)} pings; they predict a closure of {1e3 * predicted:.1f} mm/s, it is "
                f"{1e3 * closure:.1f}.",
                "Give it its own noise (beam_noise_mps of each beam) or leave it out, and look at the transducer.",
                size=float(value / others), unit="times", beams=(k + 1,),
            )
        )  # fmt: skip
    return found


GAP = 2.5
"""A step longer than this many median steps is a gap."""
_NEAREST = 60
"""Number of values nearest to zero that give the expected count of exact zeros."""


def time_findings(log: BeamLog) -> list[Finding]:
    """Times that repeat or go back (faults: the readers reject them), and gaps."""
    if log.pings < 3:
        return []
    steps = np.diff(log.time_ns) * 1e-9
    found = []
    for kind, where, text in (
        ("time_repeats", steps == 0.0, "repeat the time of the ping before"),
        ("time_goes_back", steps < 0.0, "go back in time"),
    ):
        if where.any():
            first = int(np.flatnonzero(where)[0]) + 1
            part = float(where.mean())
            found.append(
                Finding(
                    kind, "fault", part,
                    f"{where.sum()} of {log.pings} pings {text}.",
                    f"First in row {first}: {log.time_ns[first]} ns after {log.time_ns[first - 1]} ns.",
                    "Use the instrument's time of validity instead of the host's, or drop these rows before "
                    "`bottomlock fix`.",
                    size=float(where.sum()), unit="pings",
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
                "time_gaps", "warning" if part > 0.01 else "note", part,
                f"{gaps.size} {'gap' if gaps.size == 1 else 'gaps'} in time, together {missing:.3g} s of {span:.4g} s.",
                f"The median step is {usual:.4g} s; the longest is {steps[worst]:.4g} s, before row {worst + 1}.",
                "None if the instrument did not ping; the filter propagates without it. Otherwise look for lost lines "
                "of the recording.",
                size=float(gaps.size), unit="gaps",
            )
        )  # fmt: skip
    return found


def unchanged(log: BeamLog) -> NDArray[np.bool_]:
    """(n,) True where a ping repeats all readings and flags of the one before, with at least two non-zero readings."""
    same = np.zeros(log.pings, dtype=bool)
    if log.beams == 0:
        return same
    y, valid = log.velocity_mps, log.valid
    used = valid & np.isfinite(y)
    equal = (~used[1:] | (y[1:] == y[:-1])).all(axis=1) & (valid[1:] == valid[:-1]).all(axis=1)
    same[1:] = equal & ((used & (y != 0.0))[1:].sum(axis=1) >= 2)
    return same


def stale_findings(log: BeamLog, same: NDArray[np.bool_]) -> list[Finding]:
    """Whole pings that repeat unchanged, more often than readings of this resolution coincide by chance.

    Pings that a reader has marked as stale, and flagged invalid, count as well.
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
            "stale_pings", "fault" if part > 0.01 else "warning", part,
            f"{count} pings ({100.0 * part:.2g} %) repeat the whole ping before them unchanged.",
            f"{by_chance:.2g} are expected by chance; first in row {int(np.flatnonzero(same)[0])}, longest run "
            f"{int(runs.max())} pings.",
            "Drop them: a repeated reading is an old velocity, and is not independent of the ping before.",
            size=float(count), unit="pings",
        )
    ]  # fmt: skip


def zero_findings(log: BeamLog) -> list[Finding]:
    """Beams flagged valid at exactly zero: more often than neighbouring values, and amid readings far from zero."""
    found = []
    for k in range(log.beams):
        y = log.velocity_mps[log.valid[:, k], k]
        zeros = int(np.sum(y == 0.0))
        if not zeros:
            continue
        quantum = resolution(y)
        reach = float(np.sort(np.abs(y[y != 0.0]))[:_NEAREST][-1]) if zeros < y.size else 0.0
        # The count of each value next to zero: readings that pass through zero are exactly zero as often.
        near = int(np.sum((np.abs(y) <= reach) & (y != 0.0)))
        usual = near * quantum / max(2.0 * reach, quantum) if quantum else 0.0
        if poisson.sf(zeros - 1, 1.5 * usual + 1e-3) > SIGNIFICANCE or _out_of_place(y) < max(2, 0.3 * zeros):
            continue
        part = zeros / y.size
        found.append(
            Finding(
                "zero_as_valid", "fault", part,
                f"Beam {k + 1} is flagged valid with a velocity of exactly zero in {zeros} pings "
                f"({100.0 * part:.2g} %).",
                f"{usual:.2g} are expected at a resolution of {quantum:.2g} m/s; "
                f"first in row {int(np.flatnonzero(log.valid[:, k] & (log.velocity_mps[:, k] == 0.0))[0])}.",
                "Treat zero as a lost beam: clear the flag where the velocity is exactly zero.",
                size=float(zeros), unit="pings", beams=(k + 1,),
            )
        )  # fmt: skip
    return found


def _out_of_place(y: Array) -> int:
    """Number of zeros between readings more than five steps of resolution from zero.

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
    """Beams flagged valid whose range is zero or negative."""
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
                    "no_range", "note", part,
                    f"Beam {k + 1} is flagged valid without a range in {bad.sum()} pings ({100.0 * part:.2g} %).",
                    f"First in row {int(np.flatnonzero(bad)[0])}.",
                    "Do not use the range as the only test of validity.",
                    size=float(bad.sum()), unit="pings", beams=(k + 1,),
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
        for sign, text in ((1.0, "the same numbers"), (-1.0, "the same numbers with the sign changed")):
            part = float(np.mean(a[moving] == sign * b[moving]))
            if part > 0.5:
                found.append(
                    Finding(
                        "identical_beams", "fault", part,
                        f"{beam_words([i, j]).capitalize()} hold {text} in {100.0 * part:.3g} % of "
                        f"{moving.sum()} pings.",
                        "Two transducers do not agree to the last digit.",
                        "Look for a column that is read twice; until then use one of the two and treat the other as "
                        "lost.",
                        size=part, unit="of pings", beams=(i + 1, j + 1),
                    )
                )  # fmt: skip
    return found


def instrument_flag_findings(log: BeamLog, same: NDArray[np.bool_]) -> list[Finding]:
    """Contradictions between the instrument's velocity flag and its beams.

    The velocity is flagged invalid with all beams valid, or valid with fewer than three. Stale pings are left out: a
    reader may have cleared their flags.
    """
    if log.instrument_valid is None or not log.beams:
        return []
    count = log.valid.sum(axis=1)
    found = []
    rejected = (count == log.beams) & ~log.instrument_valid & ~same
    if rejected.any():
        part = float(rejected.sum() / max((count == log.beams).sum(), 1))
        found.append(
            Finding(
                "rejected_by_instrument", "note" if part < 0.2 else "warning", part,
                f"The instrument flags its velocity invalid in {rejected.sum()} pings with all {log.beams} beams "
                f"valid ({100.0 * part:.3g} %).",
                f"First in row {int(np.flatnonzero(rejected)[0])}.",
                "Valid flags of the beams are not sufficient: gate by closure and by innovation as well.",
                size=float(rejected.sum()), unit="pings",
            )
        )  # fmt: skip
    given = (count < min(3, log.beams)) & log.instrument_valid & ~same
    if given.any():
        found.append(
            Finding(
                "velocity_without_beams", "fault", float(given.mean()),
                f"The instrument flags its velocity valid in {given.sum()} pings with fewer than three valid beams.",
                f"First in row {int(np.flatnonzero(given)[0])}.",
                "Do not use that velocity: it depends on data that are not in the log.",
                size=float(given.sum()), unit="pings",
            )
        )  # fmt: skip
    return found


ADVICE = "Record in the water, with the bottom within the instrument's range."


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


def lock_findings(log: BeamLog) -> list[Finding]:
    """That the log never had lock, and why; nothing where it had."""
    why = why_never_locked(log)
    if not why:
        return []
    flagged = int(log.full.sum()) if log.beams else 0
    return [
        Finding(
            "never_locked", "warning", 1.0,
            f"The instrument never had bottom lock in this log: {why}.",
            f"{flagged} pings have all beams flagged valid. Beams, closure and mounting are not judged.",
            ADVICE,
            size=float(log.pings), unit="pings",
        )
    ]  # fmt: skip
