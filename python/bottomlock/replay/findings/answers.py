"""What a replay says without a reference: closure, each set of beams, and how far the methods are apart."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from bottomlock.replay.motion.closure import closure_sd
from bottomlock.replay.rerun import PreparedRun

Floats = NDArray[np.float64]
LEAST_APART_M = 0.01
"""Smaller distances between methods are not told."""


def answers(prepared: PreparedRun, samples: pl.DataFrame) -> list[str]:
    """A sentence each: closure, velocity without each beam, distance between the methods at the end.

    Args:
        prepared: the first run.
        samples: `tables.replay.REPLAY_SAMPLES` of the recording, first run.
    """
    return [*_beams(prepared), *_methods(samples)]


def closure_words(prepared: PreparedRun) -> str:
    """What beams left out of pings with all of them show; "" without redundant beams."""
    return next(iter(_beams(prepared)), "")


def _beams(prepared: PreparedRun) -> list[str]:
    beams, instrument = prepared.streams.beams, prepared.streams.instrument
    B = np.asarray(instrument.geometry.directions_p)
    full = beams.valid[prepared.pings].all(axis=1)
    if len(B) < 4 or not full.any() or beams.velocity_d_mps is not None:
        return []
    y = beams.velocity_mps[prepared.pings][full]
    claimed = float(instrument.beam_sd_mps.mean())
    lines = [
        (
            f"Closure of {int(full.sum())} pings of all beams: robust sigma {1e3 * closure_sd(B, y):.1f} mm/s, "
            "claimed noise of a "
            f"beam {1e3 * claimed:.1f} mm/s."
        )
    ]
    every = y @ np.linalg.pinv(B).T
    parts = []
    for k in range(len(B)):
        left = [j for j in range(len(B)) if j != k]
        if np.linalg.matrix_rank(B[left], tol=0.05) < 3:
            continue
        off = y[:, left] @ np.linalg.pinv(B[left]).T - every
        parts.append(f"{k + 1}: {1e3 * float(np.median(np.linalg.norm(off[:, :2], axis=1))):.1f}")
    if parts:
        lines.append(
            f"Without beam k the horizontal velocity differs by a median of (k: mm/s) {', '.join(parts)}."
        )
    return lines


def _methods(samples: pl.DataFrame) -> list[str]:
    end = samples.filter(pl.col("pass") == "forward").group_by("method", maintain_order=True).last()
    end = end.filter(pl.col("method") != "ins")
    if end.height < 2:
        return []
    place = end.select("north_m", "east_m").to_numpy()
    names = end["method"].to_list()
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    i, j = np.unravel_index(int(np.argmax(apart)), apart.shape)
    if apart[i, j] < LEAST_APART_M:
        return [f"At the end all {len(names)} methods are within {100 * LEAST_APART_M:.0f} cm horizontally."]
    return [
        f"At the end the methods are up to {apart[i, j]:.2f} m apart ({names[i]} and {names[j]}), horizontally."
    ]
