"""Single beams that are stuck at a value, or noisier than the others."""

import numpy as np
from numpy.typing import NDArray

from bottomlock.audit.closure import null_space
from bottomlock.audit.findings import SIGNIFICANCE
from bottomlock.audit.logs import BeamLog
from bottomlock.audit.robust import Array, sigma
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
