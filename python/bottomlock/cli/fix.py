"""The command `bottomlock fix`: velocity fixes from recorded pings, and their errors where beams are left out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from bottomlock.cli.common import Force
from bottomlock.cli.console import console, narrow_table, say
from bottomlock.cli.parameters import Out, Robust, beside, check_ending, check_option, geometry_of
from bottomlock.errors import DataError, ScenarioError
from bottomlock.kernel import FIX_METHODS
from bottomlock.text import number

if TYPE_CHECKING:
    import numpy as np
    import polars as pl
    from numpy.typing import NDArray
    from rich.table import Table

    from bottomlock.io.beams import Instrument, Pings
    from bottomlock.kernel import FixMethod
    from bottomlock.replay.beam_noise import BeamNoise
    from bottomlock.replay.robust_fix import RobustFixes


def print_noise(noise: BeamNoise, sd_mps: NDArray[np.float64]) -> None:
    """A line per group of pings: claimed and measured standard deviation, their ratio, and the tail."""
    from bottomlock.statistics.rms import rms

    claimed = 1e3 * float(rms(sd_mps))
    for group in noise.groups:
        line = f"beam noise, {group.name}: claimed sd {claimed:.3g} mm/s, "
        if group.fallback:
            use = f"factor {group.factor:.3g} is used" if group.factor != 1.0 else "the claimed sd is used"
            line += f"not measured ({group.fallback}); {use}"
        else:
            _, two, three = group.halfwidths
            line += (
                f"measured {claimed * group.factor:.3g} mm/s on {group.pings} pings with every beam, factor "
                f"{group.factor:.3g}; Student's t with {group.degrees:.3g} degrees of freedom: 95.4 % within "
                f"{two:.3g} sd, 99.7 % within {three:.3g} sd"
            )
        console.print(line, highlight=False)


SCORED = ("error_median_mps", "error_p95_mps", "sd_median_mps", "normalised_robust")
"""Columns of a score that the terminal shows."""


def score(
    name: str,
    instrument: Instrument,
    pings: Pings,
    *,
    beams: int,
    walk_mps_rts: float,
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
    from bottomlock.files.atomic_write import write_parquet
    from bottomlock.replay.beam_noise import measure_noise
    from bottomlock.replay.leave_out import leave_out

    check_option(
        "--walk-mps-per-rt-s",
        walk_mps_rts,
        "more than 0 m/s/√s",
        holds=0.0 < walk_mps_rts < math.inf,
    )
    check_option("--closure-gate", closure_gate, "0 or more", holds=closure_gate >= 0.0)
    scores = leave_out(
        instrument.geometry,
        pings.time_ns,
        pings.velocity_mps,
        pings.valid,
        instrument.beam_sd_mps,
        beams=beams,
        walk_mps_rts=walk_mps_rts,
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
        say(f"wrote {out}")


def _scores_table(scores: pl.DataFrame, title: str) -> Table:
    """A row per method and component."""
    from bottomlock.replay.leave_out import over_sets

    rows = [
        [
            row["method"], row["component"], f"{row['sets_solved']}/{row['sets']}",
            *(number(row[name]) for name in SCORED), _coverage(row),
        ]
        for row in over_sets(scores).iter_rows(named=True)
    ]  # fmt: skip
    columns = ["method", "component", "sets", "median", "p95", "σ", "error/σ", "covered %"]
    return narrow_table(title, columns, rows, left=2)


def _coverage(row: dict[str, Any]) -> str:
    """Coverage of the 1, 2 and 3 sigma intervals, percent."""
    parts = [row[f"covered_{k}sigma"] for k in (1, 2, 3)]
    return "-" if None in parts else "/".join(f"{100.0 * part:.0f}" for part in parts)


METHOD = "lc"
"""Assumes nothing of the vehicle."""


def fix(
    log: Path,
    *,
    geometry: str | None = None,
    method: Annotated[
        str | None,
        Parameter(help=f"Method: {', '.join(FIX_METHODS)}; {METHOD} by default. With --leave-out each."),
    ] = None,
    out: Out = None,
    robust: Robust = True,
    leave_out: int | None = None,
    walk_mps_per_rt_s: float = 0.1,
    closure_gate: float = 3.0,
    force: Force = False,
) -> None:
    """Solve recorded pings for velocity fixes with covariance, or score the methods on them.

    Args:
        log: Beam table of `bottomlock convert`, or CSV or Parquet with the columns time_ns, beam1_mps ..., beam1_valid
            ...; the geometry file may map other names.
        geometry: Packaged geometry or TOML file of the DVL. By default what `convert` noted beside the table.
        out: Parquet file for the fixes; LOG_fixes.parquet by default. With --leave-out for the errors of each set of
            beams.
        leave_out: Leave so many beams out of complete pings, and print the error of each method.
        walk_mps_per_rt_s: Random walk of the velocity, m/s/√s, for methods that need a prior; with --leave-out.
        closure_gate: Largest closure of a reference ping, in robust standard deviations, 0 to keep all pings; with
            --leave-out.
    """
    from bottomlock.files.overwriting import check_free
    from bottomlock.io.beams import read_beams, read_geometry
    from bottomlock.io.formats import converted_first
    from bottomlock.kernel import fix_method

    geometry = geometry_of(log, geometry)
    if geometry is None:
        with converted_first(log):
            raise DataError(
                "is missing", place=log, key="--geometry",
                expected="a packaged geometry or a TOML file",
                hint="no account of `bottomlock convert` names one beside the log",
            )  # fmt: skip
    if out is None and leave_out is None:
        out = beside(log, "fixes.parquet")
    if out is not None:
        check_ending(out, ".parquet")
        check_free(out, inputs=(log, Path(geometry)), force=force)
    instrument = read_geometry(geometry)
    with converted_first(log, instrument.columns.time):
        pings = read_beams(log, geometry=instrument)
    if leave_out is not None:
        if method is not None:
            raise ScenarioError(
                "every method is scored", place="--method and --leave-out", hint="give one of the two"
            )
        score(
            log.name, instrument, pings, beams=leave_out, walk_mps_rts=walk_mps_per_rt_s,
            closure_gate=closure_gate, robust=robust, out=out,
        )  # fmt: skip
        return
    assert out is not None  # without --leave-out it has a default
    _require_lock(pings, str(log))
    _fix(log, instrument, pings, fix_method(method or METHOD), out, robust=robust)


def _fix(
    log: Path, instrument: Instrument, pings: Pings, method: FixMethod, out: Path, *, robust: bool
) -> None:
    """Solves the pings, writes them and prints what they are."""
    import polars as pl

    from bottomlock.files.atomic_write import write_parquet

    frame, solved = _solve(instrument, pings, method, robust=robust)
    if (frame["status"] == "prior_required").any() and pings.prior_velocity_p_mps is None:
        raise DataError(
            f"method '{method}' needs the columns prior_surge_mps, prior_sway_mps, "
            "prior_heave_mps and their standard deviations",
            place=log,
        )
    write_parquet(out, frame)
    count = pl.sum_horizontal(pl.col("^beam[0-9]+_used$").cast(pl.Int64)).alias("beams")
    counts = frame.group_by(count, "status").len().sort("beams", "status", descending=[True, False])
    rows = ([str(value) for value in row] for row in counts.iter_rows())
    title = f"{frame.height} pings, method {method}"
    console.print(narrow_table(title, ["beams", "status", "pings"], rows, left=2))
    if solved is not None:
        print_noise(solved.noise, instrument.beam_sd_mps)
        _print_outliers(frame)
    say(f"wrote {out}")


def _require_lock(pings: Pings, place: str) -> None:
    """That the log had bottom lock somewhere.

    An instrument that lost a beam for a whole log flags its velocity invalid throughout, and the beams left are as good
    as ever: its flag counts against pings with every beam only.

    Raises:
        DataError: where it never had, with the reason.
    """
    from bottomlock.audit.defects import why_never_locked
    from bottomlock.audit.findings import LOCK_ADVICE
    from bottomlock.audit.logs import BeamLog

    lost = not pings.valid.all(axis=1).any()
    flag = None if lost else pings.instrument_valid
    log = BeamLog(place, pings.time_ns, pings.velocity_mps, pings.valid, instrument_valid=flag)
    why = why_never_locked(log)
    if why:
        raise DataError(
            "no velocity is solved, because the instrument never had bottom lock in this log: "
            f"{why}. {LOCK_ADVICE}",
            place=place,
        )


def _solve(
    instrument: Instrument, pings: Pings, method: FixMethod, *, robust: bool
) -> tuple[pl.DataFrame, RobustFixes | None]:
    """The table of fixes, and what was measured and screened where `robust`."""
    import numpy as np

    from bottomlock.kernel import solve_velocity
    from bottomlock.replay.robust_fix import solve_robust

    cov = None if pings.prior_sd_mps is None else pings.prior_sd_mps[:, :, None] ** 2 * np.eye(3)
    beams = (pings.velocity_mps, pings.valid)
    given: dict[str, Any] = {
        "method": method, "beam_sd_mps": instrument.beam_sd_mps,
        "prior_velocity_p_mps": pings.prior_velocity_p_mps, "prior_cov_m2ps2": cov,
    }  # fmt: skip
    if not robust:
        return solve_velocity(instrument.geometry, *beams, **given).to_frame(pings.time_ns), None
    given["instrument_valid"] = pings.instrument_valid
    solved = solve_robust(instrument.geometry, pings.time_ns, *beams, **given)
    return solved.to_frame(pings.time_ns), solved


def _print_outliers(frame: pl.DataFrame) -> None:
    """How many pings could be tested for outliers, and with what outcome."""
    count = dict(frame.group_by("outlier_test").len().iter_rows())
    console.print(
        f"outliers: {count.get('passed', 0)} pings passed, {count.get('beam_rejected', 0)} with a beam rejected, "
        f"{count.get('down_weighted', 0)} down-weighted (no beam identified), {count.get('untested', 0)} untested "
        "(without redundant beams no outlier can be found)",
        highlight=False,
    )
