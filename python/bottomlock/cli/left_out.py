"""`bottomlock fix --leave-out`: the error of each method where beams are left out of recorded pings."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from rich.table import Table

from bottomlock.cli.beam_noise import print_noise
from bottomlock.cli.console import console, narrow_table
from bottomlock.errors import ScenarioError
from bottomlock.files.atomic_write import write_parquet
from bottomlock.io.beams import Instrument, Pings
from bottomlock.pages.numbers import number
from bottomlock.replay.beam_noise import measure_noise
from bottomlock.replay.leave_out import VelocityWalk, leave_out, over_sets

SCORED = (
    "error_median_mps",
    "error_p95_mps",
    "sd_median_mps",
    "normalised_robust",
)
"""Columns of a score that the terminal shows."""


def score(
    name: str,
    instrument: Instrument,
    pings: Pings,
    *,
    beams: int,
    walk: VelocityWalk,
    closure_gate: float,
    robust: bool,
    out: Path | None,
) -> None:
    """Prints the errors of every method without so many beams, and writes them per set of beams where a file is named.

    The reference is a ping with all of its beams.

    Raises:
        ScenarioError: for a gate below zero or a walk that is not above it.
        DataError: for a number of beams that cannot be left out, or a log without a complete ping.
    """
    if not (np.isfinite(walk.walk_mps_rts) and walk.walk_mps_rts > 0.0):
        raise ScenarioError(
            f"is {walk.walk_mps_rts}", key="--walk-mps-per-rt-s", expected="more than 0 m/s/√s"
        )
    if not closure_gate >= 0.0:
        raise ScenarioError(f"is {closure_gate}", key="--closure-gate", expected="0 or more")
    scores = leave_out(
        instrument.geometry,
        pings.time_ns,
        pings.velocity_mps,
        pings.valid,
        instrument.beam_sd_mps,
        beams=beams,
        walk=walk,
        closure_gate=closure_gate or None,
        robust=robust,
        instrument_valid=pings.instrument_valid,
    )
    title = f"{name}: {beams} of {instrument.geometry.beams} beams left out of {scores['pings'][0]} pings"
    console.print(_scores_table(scores, title))
    console.print(
        "m/s; medians over the sets of beams that a method solves. surge, sway, heave: error against least squares of "
        "all beams; beam: against the reading of the beam left out. error/σ: 1.4826 × median of error over claimed σ, "
        "1 for a consistent method with Gaussian noise. covered %: errors within the 1, 2 and 3 sigma intervals, "
        "expected 68/95/99.7."
    )
    if closure_gate:
        console.print(
            "Pings with an outlying closure are not scored, which raises the coverage; --closure-gate 0 scores all."
        )
    if robust:
        noise = measure_noise(
            instrument.geometry,
            pings.velocity_mps,
            pings.valid,
            instrument.beam_sd_mps,
            pings.instrument_valid,
        )
        print_noise(noise, instrument.beam_sd_mps)
    if out is not None:
        write_parquet(out, scores)
        console.print(f"wrote {out}", soft_wrap=True, highlight=False)


def _scores_table(scores: pl.DataFrame, title: str) -> Table:
    """A row per method and component."""
    table = narrow_table(
        title,
        ["method", "component"],
        ["sets", "median", "p95", "σ", "error/σ", "covered %"],
    )
    for row in over_sets(scores).iter_rows(named=True):
        numbers = (number(row[name]) for name in SCORED)
        table.add_row(
            row["method"], row["component"], f"{row['sets_solved']}/{row['sets']}", *numbers, _coverage(row)
        )
    return table


def _coverage(row: dict[str, Any]) -> str:
    """Coverage of the 1, 2 and 3 sigma intervals, percent."""
    parts = [row[f"covered_{k}sigma"] for k in (1, 2, 3)]
    return "-" if None in parts else "/".join(f"{100.0 * part:.0f}" for part in parts)
