"""What a replay says without a reference: closure, each set of beams, and how far the methods are apart."""

import numpy as np
import polars as pl

from bottomlock.own_method import DEAD_RECKONING
from bottomlock.recordings.closure import closure_sd
from bottomlock.replay.findings.against_reckoning import metres
from bottomlock.replay.findings.attitude_checks import start_correction
from bottomlock.replay.rerun import PreparedRun
from bottomlock.statistics.replay import track_table

LEAST_APART_M = 0.01
"""Smaller distances between methods are not told."""


def answers(prepared: PreparedRun, samples: pl.DataFrame, taken: str) -> list[str]:
    """A sentence each: end and way, heading at the start, closure, velocity without a beam, distance between methods.

    Args:
        prepared: the recording and its start.
        samples: `tables.replay.REPLAY_SAMPLES` of the recording.
        taken: method whose track is told beside dead reckoning's.
    """
    return [
        *_tracks(samples, taken),
        *_heading(prepared, samples, taken),
        *_beams(prepared),
        *_methods(samples),
    ]


def _tracks(samples: pl.DataFrame, taken: str) -> list[str]:
    rows = track_table(samples).filter(
        (pl.col("pass") == "forward") & pl.col("method").is_in([taken, DEAD_RECKONING])
    )
    return [
        f"{row['method']} ends {row['north_m']:+,.1f} m north, {row['east_m']:+,.1f} m east of the origin, 1 sigma "
        f"{metres(row['sd_position_north_m'])} and {metres(row['sd_position_east_m'])}; way {metres(row['way_m'])}, "
        f"mean speed {row['speed_mps']:.2g} m/s."
        for row in rows.iter_rows(named=True)
    ]


def _heading(prepared: PreparedRun, samples: pl.DataFrame, taken: str) -> list[str]:
    """What the whole log says of the heading at the start, where a method was smoothed."""
    found = start_correction(prepared, samples, taken)
    if found is None:
        return []
    text = (
        f"Heading at the start: the whole log corrects it by {found.change_deg:+.1f} deg, {found.sigmas:.1f} "
        f"times its 1 sigma of {found.sd_deg:.3g} deg ({taken}); {found.left_deg:.3g} deg are left."
    )
    return [text]


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
